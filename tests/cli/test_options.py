"""Values of options that make no sense are refused in one line, before any work."""

import pytest


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("smooth R --out O --seed -1", '"-1" for --seed. Must be >= 0'),
        ("compare R --truth T --out O --seed -1", '"-1" for --seed. Must be >= 0'),
        ("demo --seed -1", '"-1" for --seed. Must be >= 0'),
        ("simulate --out O --seed -1", '"-1" for --seed. Must be >= 0'),
        ("simulate --out O --readout-s -1", '"-1.0" for --readout-s. Must be a finite number >= 0'),
        ("simulate --out O --readout-s 0.1", "readout_s: a readout of 0.1 s; expected 0 s to 1/15 s"),
        ("simulate --out O --fps 0", '"0" for --fps. Must be >= 1'),
        ("online --video V --video-delay nan", '"nan" for --video-delay. Must be a finite number >= 0'),
        ("survey L --out O --speed -1", '"-1.0" for --speed. Must be a finite number >= 0'),
        ("survey L --out O --vertical-speed inf", '"inf" for --vertical-speed. Must be a finite number >= 0'),
        ("survey L --out O --drop 1.5", "key survey.drop: found 1.5; expected less than 1"),
        ("survey L --out O --frame-rate 0", "key survey.frame_rate: found 0.0; expected greater than 0"),
        ("survey L --out O --truth 49,8,nan", "'49,8,nan'; expected LATITUDE,LONGITUDE,HEIGHT in degrees"),
        ("survey L --out O --truth 91,8,0", "'91,8,0'; expected LATITUDE,LONGITUDE,HEIGHT in degrees"),
        ("survey L --out O --truth 49,8", "'49,8'; expected LATITUDE,LONGITUDE,HEIGHT in degrees"),
        ("landmarks build R --out O --levels 0", "'0' for --levels. Input should be greater than 0"),
        (
            "landmarks build R --out O --max-sigma-px x",
            "'x' for --max-sigma-px. Input should be a valid number",
        ),
    ],
)
def test_an_impossible_value_is_one_line(vgps_verb, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    code, out, err = vgps_verb(*words.split())
    assert (code, out) == (2, "")
    assert err.startswith("vgps: ") and err.count("\n") == 1 and message in err
    assert list(tmp_path.iterdir()) == []


def test_compare_checks_its_folder_before_the_work(vgps_verb, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("")
    code, _, err = vgps_verb("compare", tmp_path / "nowhere", "--truth", "T", "--out", taken)
    assert code == 2 and "taken is a file; expected a folder" in err and err.count("\n") == 1
