"""What is said of a time offset that stage D decided on, and of a camera upside down."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solutions import PINHOLE, make_solution

from vgps.config import SensorsConfig, StartConfig
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.pipeline.sensor_notes import clock_notes, upright_notes, with_moving_note
from vgps.solution import Trajectory

HELD = Sensors.fixed(np.zeros(3))
CERTAIN = HELD.with_time_offset(TimeOffset(0.2, 0.02))
TOLD = replace(CERTAIN, shown_by_poses=True)
LIKELY = HELD.with_time_offset(TimeOffset(0.2, 0.05), 0.8)


def notes(before, after, speed_m_s=5.0):
    path = Trajectory(np.arange(4.0), np.tile(np.eye(4), (4, 1, 1)))
    path.world_T_camera[:, 0, 3] = speed_m_s * path.t_s
    batch = SimpleNamespace(sensors=after, time_offset_sigma_s=np.array([0.02]), trajectory=path)
    return clock_notes(SimpleNamespace(sensors=before), batch, SensorsConfig())


@pytest.mark.parametrize("before", [HELD, LIKELY])
def test_a_time_offset_that_the_poses_told_is_named(before):
    (text,) = notes(before, TOLD)
    assert "0.200 s (standard deviation 0.020 s) older" in text and "all poses" in text


def test_one_that_was_held_without_being_seen_is_told_with_what_it_may_move():
    (text,) = notes(HELD, replace(HELD, held_sigma_s=0.3))
    assert "held at 0 s, uncertain by 0.30 s or 1.5 m" in text
    assert notes(HELD, replace(HELD, held_sigma_s=0.1)) == ()
    assert notes(HELD, replace(HELD, held_sigma_s=0.3), speed_m_s=0.1) == ()


def test_one_that_stage_d_could_not_try_is_named_with_its_probability():
    (text,) = notes(LIKELY, LIKELY)
    assert "with a probability of 80%" in text


@pytest.mark.parametrize(("before", "after"), [(HELD, HELD), (LIKELY, HELD), (CERTAIN, TOLD)])
def test_nothing_is_said_twice_or_of_a_clock_that_is_right(before, after):
    assert notes(before, after) == ()


def test_what_clocks_that_agree_differ_by_is_named_once_it_is_two_sigmas():
    began = replace(CERTAIN, agreed=CERTAIN.prior_time_offset)
    (text,) = notes(began, replace(began, time_offset_s=-0.041, shown_by_poses=True))
    assert "are -0.041 s (standard deviation 0.020 s) older" in text
    assert notes(began, replace(began, time_offset_s=0.039, shown_by_poses=True)) == ()


UPRIGHT = [(0, 0), (-90, 30), (-100, 0), (70, 60), (-30, 100)]


@pytest.mark.parametrize(
    ("pitch_deg", "roll_deg", "below_deg"),
    [*((*one, None) for one in UPRIGHT), (-30, 180, 60), (0, -120, 30)],
)
def test_a_head_below_the_horizon_is_said_wherever_the_camera_looks(pitch_deg, roll_deg, below_deg):
    """Rotations of a drone that turned on the spot and flew away were wrong by 178 degrees, sigmas 5."""
    looks_north = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turned = Rotation.from_euler(
        "ZXY", [[heading, pitch_deg, roll_deg] for heading in range(0, 360, 10)], True
    )
    poses = np.tile(np.eye(4), (len(turned), 1, 1))
    poses[:, :3, :3] = turned.as_matrix() @ looks_north
    poses[:7, :3, :3] = np.diag([1.0, -1.0, -1.0]) @ poses[:7, :3, :3]  # a few frames do not count
    found = upright_notes(poses, StartConfig())
    assert [text.split(" points ")[1].split(" degrees")[0] for text in found] == (
        [] if below_deg is None else [str(below_deg)]
    )


@pytest.mark.parametrize(
    ("pitch_deg", "airborne", "said"), [(90, "yes", 1), (90, "no", 0), (60, "yes", 0), (-90, "yes", 0)]
)
def test_a_drone_that_looks_at_the_sky_is_upside_down(pitch_deg, airborne, said):
    """Its head is level then, as that of one that looks straight down."""
    looks_north = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    poses = np.tile(np.eye(4), (9, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("X", pitch_deg, degrees=True).as_matrix() @ looks_north
    found = upright_notes(poses, StartConfig(airborne=airborne))
    assert len(found) == said and all("up at the sky, 90 degrees" in text for text in found)


def test_a_lorry_is_named_with_its_share_and_its_frames_but_nothing_small():
    width, height = PINHOLE.width, PINHOLE.height
    small, large = [4, 9, 0, 0, width // 4, height // 4], [2, 3, 0, 0, width // 2, height]
    run = make_solution(np.arange(10.0), np.tile(np.eye(4), (10, 1, 1)), camera=PINHOLE)
    with_small = replace(run, moving_regions=np.array([small]))
    assert with_moving_note(run) is run and with_moving_note(with_small) is with_small
    found = with_moving_note(replace(run, warnings=("before",), moving_regions=np.array([small, large])))
    before, note = found.warnings
    assert before == "before" and "up to 50% of the picture in 2 frames from 2.0 to 3.0 s" in note
