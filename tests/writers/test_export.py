"""Exports of a run folder, read back with other programs' readers where there are any."""

from dataclasses import replace
from pathlib import Path

import pytest

from vgps.errors import RunFolderError
from vgps.writers.export import FORMATS, export
from vgps.writers.export_job import ExportJob


def test_tum_is_the_file_of_the_run_folder(run: Path, tmp_path: Path) -> None:
    export(run, "tum", tmp_path / "deeper/out.tum")
    assert (tmp_path / "deeper/out.tum").read_bytes() == (run / "poses.tum").read_bytes()
    assert [path.name for path in (tmp_path / "deeper").iterdir()] == ["out.tum"]


def test_an_unknown_format_names_those_there_are(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"unknown format 'tumm'; expected one of .*ply, splat, tum"):
        export(run, "tumm", tmp_path / "out")


def test_what_is_no_run_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="not a folder"):
        export(tmp_path / "absent", "ply", tmp_path / "out.ply")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("to", sorted(name for name, form in FORMATS.items() if form.folder is None))
def test_a_failure_keeps_the_file_that_was_there(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, to: str
) -> None:
    out = tmp_path / "out"
    out.write_text("earlier")

    def half(_: ExportJob, path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(FORMATS, to, replace(FORMATS[to], write=half))
    with pytest.raises(RunFolderError, match="out: cannot be written"):
        export(run, to, out)
    assert out.read_text() == "earlier"
    assert {path.name for path in tmp_path.iterdir()} == {"run", "out"}


def test_an_existing_folder_is_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="is a folder; expected the name of a file"):
        export(run, "ply", tmp_path)


def test_a_colmap_model_replaces_an_earlier_one_and_nothing_else(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "model"
    export(run, "colmap", out)
    (out / "cameras.txt").write_text("an older one")
    (out / "notes.txt").write_text("mine")
    export(run, "colmap", out)
    assert (out / "cameras.txt").read_text() != "an older one"
    assert (out / "notes.txt").read_text() == "mine"
    (out / "origin.json").unlink()
    with pytest.raises(RunFolderError, match=r"holds other files and no origin\.json"):
        export(run, "colmap", out)
