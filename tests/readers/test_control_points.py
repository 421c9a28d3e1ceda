import pytest

from vgps.errors import RecordingError
from vgps.readers.control_points import read_control_points


def test_local_and_geodetic(tmp_path):
    path = tmp_path / "control_points.csv"
    path.write_text("frame,u_px,v_px,east_m,north_m,up_m\n3,10.5,20.5,1,2,3\n4,11,21,1,2,3\n")
    points = read_control_points(path)
    assert points.frame.tolist() == [3, 4]
    assert points.uv_px.tolist() == [[10.5, 20.5], [11, 21]]
    assert points.world_p_point.tolist() == [[1, 2, 3]] * 2
    assert not points.geodetic
    path.write_text("frame,u_px,v_px,latitude_deg,longitude_deg,height_m\n0,1,2,49.1,8.2,163\n")
    points = read_control_points(path)
    assert points.geodetic
    assert points.world_p_point.tolist() == [[49.1, 8.2, 163]]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("-1,1,2,1,2,3", "line 2: an impossible observation"),
        ("0.5,1,2,1,2,3", "line 2: an impossible observation"),
        ("1e308,1,2,1,2,3", "line 2: an impossible observation"),
        ("inf,1,2,1,2,3", "line 2: an impossible observation"),
        ("0,1,,1,2,3", "line 2: an impossible observation"),
        ("0,1,2,1,2,high", "line 2: 'high' in column up_m"),
        ("", "no control points"),
    ],
)
def test_an_impossible_observation_is_refused(tmp_path, row, message):
    path = tmp_path / "control_points.csv"
    path.write_text("frame,u_px,v_px,east_m,north_m,up_m\n" + row + "\n")
    with pytest.raises(RecordingError, match=message):
        read_control_points(path)


def test_a_latitude_beyond_the_pole_is_refused(tmp_path):
    path = tmp_path / "control_points.csv"
    path.write_text("frame,u_px,v_px,latitude_deg,longitude_deg,height_m\n0,1,2,91,8.2,163\n")
    with pytest.raises(RecordingError, match="line 2"):
        read_control_points(path)


def test_a_missing_column_is_named(tmp_path):
    path = tmp_path / "control_points.csv"
    path.write_text("frame,u_px,v_px,east_m,north,up_m\n0,1,2,1,2,3\n")
    with pytest.raises(RecordingError, match=r"no column north_m .*did you mean north\?"):
        read_control_points(path)
