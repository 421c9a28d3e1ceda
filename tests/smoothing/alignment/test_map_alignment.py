from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_fixes import fixes_of_size

from vgps.config import Config, StartConfig
from vgps.smoothing.alignment import map_alignment
from vgps.smoothing.alignment.map_alignment import align_to_fixes
from vgps.solution import Trajectory

RNG = np.random.default_rng(0)
DOWN = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] @ Rotation.from_euler("x", -60.0, degrees=True).as_matrix()
MAP_R_WORLD = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
FIELD = RNG.uniform([-20.0, 0.0, -0.3], [100.0, 50.0, 0.3], (500, 3))
CLOUD = RNG.uniform([-20.0, 0.0, -30.0], [100.0, 50.0, 30.0], (500, 3))


def map_of(t_s, points, **given):
    """What alignment asks of a map beside its path."""
    plain = {"bending": np.full(len(t_s), np.nan), "moving": np.ones(len(t_s), dtype=bool)}
    return SimpleNamespace(t_s=t_s, points=points, **(plain | given))


def test_a_map_waits_for_the_motion_that_tells_heading_from_an_antenna_that_swings(monkeypatch):
    """A camera turns while it moves by 3 m, its antenna 0.7 m to one side, which is no motion of it."""
    t_s = np.arange(21.0)
    world, true = np.tile(np.eye(4), (21, 1, 1)), np.array([0.7, 0.0, 0.0])
    world[:, :3, :3] = Rotation.from_euler("z", 6.0 * t_s[:, None], degrees=True).as_matrix() @ DOWN
    world[:, 0, 3] = 0.15 * t_s
    antenna = world[:, :3, 3] + world[:, :3, :3] @ true
    fixes = fixes_of_size(t_s, antenna, np.full(21, 0.02), np.full(21, 0.02))
    in_map = map_of(t_s, CLOUD)
    monkeypatch.setattr(map_alignment, "map_trajectory", lambda _: Trajectory(t_s, world))
    placed = align_to_fixes(in_map, fixes, np.zeros(3), Config())
    off = Rotation.from_matrix(placed.update.similarity.world_R_map)
    assert np.degrees(off.magnitude()) > 20.0  # of which it is sure
    assert align_to_fixes(in_map, fixes, np.zeros(3), Config(), 1.0) is None
    assert align_to_fixes(in_map, fixes, true, Config()) is not None


@pytest.mark.parametrize("bends_deg", [0.0, 5.0])
def test_a_climb_waits_for_a_way_aside_that_no_bend_of_the_video_explains(monkeypatch, bends_deg):
    """A camera climbs by 5 m and sways by 3 cm, as a bend of the video does; then it flies 5 m ahead."""
    t_s, world = np.arange(41.0), np.tile(np.eye(4), (41, 1, 1))
    world[:, :3, :3], world[:, 2, 3] = DOWN, np.minimum(0.25 * t_s, 5.0)
    world[:, 0, 3] = 0.03 * np.sin(t_s / 3.0)
    world[21:, 1, 3] = 0.25 * (t_s[21:] - 20.0)
    fixes = fixes_of_size(t_s, world[:, :3, 3], np.full(41, 0.005), np.full(41, 0.005))

    def placed(frames):
        bending = np.full(frames, np.radians(bends_deg) ** 2 / frames)
        in_map = map_of(t_s[:frames], CLOUD, bending=bending)
        monkeypatch.setattr(
            map_alignment, "map_trajectory", lambda _: Trajectory(t_s[:frames], world[:frames])
        )
        return align_to_fixes(in_map, fixes, np.zeros(3), Config(start=StartConfig(airborne="yes")))

    assert placed(21) is None and placed(41) is not None
    assert (placed(24) is None) == (bends_deg > 0.0)


@pytest.mark.parametrize("stands", [True, False])
def test_neither_a_long_stop_nor_a_long_way_without_fixes_holds_a_map_back(monkeypatch, stands):
    """Ten minutes at 30 frames/s, then 5 m ahead within four seconds."""
    t_s, world = np.arange(18_120) / 30.0, np.tile(np.eye(4), (18_120, 1, 1))
    drives = t_s >= 600.0
    world[drives, 1, 3] = 1.25 * (t_s[drives] - 600.0)
    world[:, :3, :3] = DOWN
    fix_s = np.arange(0.0 if stands else 600.0, 604.0)
    antenna = np.stack([0.0 * fix_s, 1.25 * np.maximum(fix_s - 600.0, 0.0), 0.0 * fix_s], axis=1)
    fixes = fixes_of_size(fix_s, antenna, np.full(len(fix_s), 0.02), np.full(len(fix_s), 0.02))
    monkeypatch.setattr(map_alignment, "map_trajectory", lambda _: Trajectory(t_s, world))
    in_map = map_of(t_s, CLOUD, moving=drives | (not stands))
    assert align_to_fixes(in_map, fixes, np.zeros(3), Config()) is not None


def aligned(monkeypatch, points, airborne):
    """Return the error in degrees and the warning of a straight flight sideways that looks down."""
    t_s, world = np.arange(41.0), np.tile(np.eye(4), (41, 1, 1))
    world[:, :3, :3], world[:, :3, 3] = DOWN, np.linspace([0.0, 0.0, 30.0], [80.0, 0.0, 30.0], 41)
    fixes = fixes_of_size(t_s, world[:, :3, 3], np.full(41, 1.0), np.full(41, 1.0))
    turn = np.eye(4)
    turn[:3, :3] = MAP_R_WORLD
    in_map = map_of(t_s, points @ MAP_R_WORLD.T)
    monkeypatch.setattr(map_alignment, "map_trajectory", lambda _: Trajectory(t_s, turn @ world))
    config = Config(start=StartConfig(airborne=airborne))
    result = align_to_fixes(in_map, fixes, np.zeros(3), config)
    off = Rotation.from_matrix(result.update.similarity.world_R_map @ MAP_R_WORLD)
    return float(np.degrees(off.magnitude())), result.warnings[0]


@pytest.mark.parametrize(
    "airborne, points, right, said",
    [
        (
            "yes",
            FIELD,
            True,
            "roll or pitch: the land in view is assumed level with a standard deviation of 10",
        ),
        ("yes", CLOUD, False, "the camera's pitch is assumed level with a standard deviation of 60 degrees"),
        ("no", FIELD, False, "roll: the camera is assumed level with a standard deviation of 5 degrees"),
    ],
)
def test_the_land_levels_a_straight_flight_and_the_warning_says_what_was_assumed(
    monkeypatch, airborne, points, right, said
):
    off_deg, warning = aligned(monkeypatch, points, airborne)
    assert (off_deg < 1.0) == right and said in warning
