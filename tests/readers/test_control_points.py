import numpy as np
import pytest

from vgps.crs import coordinate_system, egm96
from vgps.errors import CoordinateSystemError, RecordingError
from vgps.readers.control_points import PointSystem, read_control_points


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


def test_names_roles_and_sigmas(tmp_path):
    path = tmp_path / "control_points.csv"
    path.write_text(
        "name,role,frame,u_px,v_px,east_m,north_m,up_m,sigma_east_m,sigma_north_m,sigma_up_m\n"
        "A,control,0,1,2,3,4,5,0.01,0.01,0.02\nB,Check,0,1,2,6,7,8,,,\n"
    )
    points = read_control_points(path)
    assert points.name == ("A", "B") and points.check.tolist() == [False, True]
    assert points.sigma_m.tolist() == [[0.01, 0.01, 0.02], [0, 0, 0]]
    path.write_text("frame,u_px,v_px,east_m,north_m,up_m\n0,1,2,3,4,5\n1,1,2,3,4,5\n1,1,2,9,9,9\n")
    assert read_control_points(path).name == ("1", "1", "2")


@pytest.mark.parametrize(
    ("columns", "row", "message"),
    [
        ("role", "judge", "line 2: role 'judge'; expected control or check"),
        ("sigma_up_m", "-1", "line 2: a negative sigma"),
    ],
)
def test_what_a_mark_cannot_be(tmp_path, columns, row, message):
    path = tmp_path / "control_points.csv"
    path.write_text(f"frame,u_px,v_px,east_m,north_m,up_m,{columns}\n0,1,2,3,4,5,{row}\n")
    with pytest.raises(RecordingError, match=message):
        read_control_points(path)


def test_heights_above_a_geoid(tmp_path):
    path = tmp_path / "control_points.csv"
    path.write_text("frame,u_px,v_px,latitude_deg,longitude_deg,height_m\n0,1,2,49,8.4,100\n")
    points = read_control_points(path, PointSystem(geoid="egm96"))
    assert points.world_p_point[0].tolist() == pytest.approx([49, 8.4, 100 + egm96().height_m(49, 8.4)])


@pytest.mark.slow
def test_a_projected_system(tmp_path):
    path = tmp_path / "control_points.csv"
    expected = [[49.0, 8.4, 160.0]]
    x, y, z = coordinate_system((49, 8.4), "EPSG:25832").from_geodetic(np.array(expected))[0]
    path.write_text(f"frame,u_px,v_px,easting_m,northing_m,height_m\n0,1,2,{x},{y},{z}\n")
    points = read_control_points(path, PointSystem("EPSG:25832"))
    assert points.geodetic and "up to 1 m" in points.notes[0]
    np.testing.assert_allclose(points.world_p_point, expected, atol=1e-9)
    with pytest.raises(RecordingError, match="of an unknown coordinate system; name it with --control-crs"):
        read_control_points(path)
    with pytest.raises(CoordinateSystemError, match=r"needs the grid de_bkg_gcg2016\.tif"):
        read_control_points(path, PointSystem("EPSG:25832+7837"))


@pytest.mark.parametrize(
    "header", ["EPSG:32632", "WGS84 UTM 32N", "+proj=utm +zone=32 +datum=WGS84 +units=m"]
)
def test_odm_s_list(tmp_path, header):
    path = tmp_path / "gcp_list.txt"
    x, y, z = coordinate_system((49, 8.4), "EPSG:32632").from_geodetic(np.array([[49.0, 8.4, 160.0]]))[0]
    rows = f"{x} {y} {z} 10.5 20.5 frame_000003.jpg\n{x}\t{y}\t{z}\t11\t21\tframe_000007.jpg\tG1\n"
    path.write_text(f"{header}\n# a comment\n{rows}")
    points = read_control_points(path)
    np.testing.assert_allclose(points.world_p_point, [[49.0, 8.4, 160.0]] * 2, atol=1e-9)
    assert points.frame.tolist() == [3, 7] and points.name[1] == "G1"
    assert points.uv_px.tolist() == [[10.5, 20.5], [11, 21]]
    with pytest.raises(RecordingError, match=r"line 3: no image frame_000003\.jpg; expected images"):
        read_control_points(path, images=["a.jpg"])
    renamed = read_control_points(path, images=["frame_000007.jpg", "frame_000003.jpg"])
    assert renamed.frame.tolist() == [1, 0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Gauss Krueger\n1 2 3 4 5 a1.jpg\n", "line 1: 'Gauss Krueger' names no coordinate system"),
        ("EPSG:32632\n1 2 3 4 five a1.jpg\n", "line 2: not an observation; expected x y z u_px v_px image"),
        ("EPSG:32632\n1 2 3 4 5 frame.jpg\n", r"line 2: no frame number in frame\.jpg"),
        ("EPSG:32632\n", "no control points"),
    ],
)
def test_a_list_that_odm_would_not_take(tmp_path, text, message):
    path = tmp_path / "gcp_list.txt"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message):
        read_control_points(path)
