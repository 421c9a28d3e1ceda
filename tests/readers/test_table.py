import numpy as np
import pytest

from vgps.errors import GyroLogError
from vgps.readers.table import first_unordered, read_samples, read_table


@pytest.fixture
def read(tmp_path):
    def written(text: str):
        (tmp_path / "t.csv").write_text(text)
        return read_table(tmp_path / "t.csv", GyroLogError)

    return written


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_columns_by_name_with_comments_and_line_numbers(read, separator):
    text = "# comment\nT s,field.x\n1,2\n\n# another\n3,\n".replace(",", separator)
    table = read(text)
    assert table.columns == ("t_s", "x")
    assert table.line.tolist() == [3, 6]
    np.testing.assert_array_equal(table.numbers("x"), [2.0, np.nan])
    assert table.text("t_s") == ["1", "3"]


def test_rows_with_too_few_cells_are_listed_and_more_cells_are_ignored(read):
    table = read("a,b\n1,2\n3\n4,5,6\n")
    assert table.short_lines == (3,)
    assert table.numbers("b").tolist() == [2.0, 5.0]


def test_a_cell_that_is_not_a_number(read):
    table = read("a\n1\nx\n")
    np.testing.assert_array_equal(table.numbers("a", lenient=True), [1.0, np.nan])
    with pytest.raises(GyroLogError, match=r"t\.csv, line 3: 'x' in column a; expected a number"):
        table.numbers("a")


def test_a_missing_column_is_named_with_a_likely_misspelling(read):
    table = read("latitud,y\n1,2\n")
    assert table.find("x", "y") == "y" and table.find("x") is None
    with pytest.raises(GyroLogError, match=r"line 1: no column latitude .*did you mean latitud\?"):
        table.require("latitude", "lat_deg")
    with pytest.raises(GyroLogError, match="add a column wx"):
        table.require("wx")


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "the file is empty"), ("# x\n", "only comments"), ("a,b,a\n1,2,3\n", "column a appears twice")],
)
def test_files_without_a_table(read, text, message):
    with pytest.raises(GyroLogError, match=message):
        read(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t_s,x,y\n", "0 usable samples; expected at least 2"),
        ("t_s,x,y\n0,1,2\n0,3,4\n1,nan,0\n", "1 usable samples"),
        ("t_s,x\n0,1\n1,2\n", "no column y"),
        ("t_s,x,y\n0,1,2\n1,fast,2\n", "line 3: 'fast' in column x; expected a number"),
    ],
)
def test_a_table_without_samples_is_refused(tmp_path, text, message):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(GyroLogError, match=message):
        read_samples(tmp_path / "t.csv", ("x", "y"), GyroLogError)


@pytest.mark.parametrize(
    ("times", "row"),
    [
        ([], None),
        ([0, 1, 2.5], None),
        ([0, 1, 1], 2),
        ([0, np.nan, 2], 1),
        ([-np.inf, 1], 0),
        ([1, np.inf], 1),
    ],
)
def test_the_first_row_out_of_order(times, row):
    assert first_unordered(np.array(times, float)) == row


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "t.csv").open("wb") as stream:
        stream.truncate(1_000_000_001)  # a sparse file
    with pytest.raises(
        GyroLogError, match=r"1\.0 GB; expected at most 1 GB; cut it to the time of the video"
    ):
        read_table(tmp_path / "t.csv", GyroLogError)
