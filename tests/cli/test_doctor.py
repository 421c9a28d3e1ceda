import sys

from packaging.requirements import Requirement
from solutions import short_drive

from vgps.runtime import doctor
from vgps.writers.run_folder import write_run

REQUIRED = [
    "no-such-package>=2",
    "also-absent; extra == 'las'",
    "numpy>=99",
    "gone; sys_platform == 'nowhere'",
]


def test_a_whole_installation_lacks_nothing(vgps_verb):
    code, out, err = vgps_verb("doctor")
    assert (code, err) == (0, "") and "gtsam" in out and "h264" in out
    assert out.splitlines()[-1] == "all that vgps needs is here"


def test_what_is_missing_is_named_with_its_remedy(vgps_verb, monkeypatch):
    monkeypatch.setattr(doctor, "CODECS", ("h264", "no_such_codec"))
    monkeypatch.setattr(doctor, "requires", lambda _: REQUIRED)
    code, out, err = vgps_verb("doctor")
    assert code == 2 and "not installed" in out and "gone" not in out
    assert err.splitlines() == [
        'no-such-package: pip install "no-such-package"',
        'numpy: pip install "numpy>=99"',
        "FFmpeg: install a PyAV with no_such_codec, or convert such videos",
    ]


def test_the_extra_of_a_package_is_that_of_its_marker():
    assert doctor._extra(Requirement("a>=1")) == ""
    assert doctor._extra(Requirement("a; python_version >= '3' and extra == 'las'")) == "las"
    assert doctor._extra(Requirement("a; sys_platform == 'nowhere' and extra == 'las'")) is None


def test_without_the_viewer_the_remedy_is_one_line(vgps_verb, tmp_path, monkeypatch):
    write_run(short_drive(), tmp_path / "run")
    for name in [name for name in sys.modules if name.startswith("vgps.viewer.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rerun", None)
    code, _, err = vgps_verb("inspect", tmp_path / "run", "--save", tmp_path / "f.rrd")
    assert code == 2 and err.strip() == 'vgps: the viewer is not installed; pip install "vgps[viewer]"'
