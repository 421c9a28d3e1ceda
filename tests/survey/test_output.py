import pytest

from vgps.errors import RunFolderError
from vgps.survey.output import check_files


@pytest.mark.parametrize(
    ("out", "plot", "message"),
    [
        ("s.yaml", "s.yaml", "name of both the survey and its plot; name another file with --plot"),
        ("s.yaml", "s.txt", r"cannot plot to \.txt; expected \.png"),
        ("s.yaml", "s", "cannot plot to a file without a suffix"),
        ("folder", "s.png", "folder: is a folder"),
    ],
)
def test_files_that_cannot_be_written_are_refused_before_the_work(tmp_path, out, plot, message):
    (tmp_path / "folder").mkdir()
    with pytest.raises(RunFolderError, match=message):
        check_files(tmp_path / out, tmp_path / plot)


@pytest.mark.parametrize("suffix", [".png", ".PDF", ".svg"])
def test_checking_writes_nothing(tmp_path, suffix):
    check_files(tmp_path / "s.yaml", tmp_path / f"s{suffix}")
    assert list(tmp_path.iterdir()) == []
