"""Tests of paths of cameras that do not look where they go."""

import numpy as np
import pytest

from vgps.simulate import SCENES, build_motion


def positions_and_axes(name: str, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return centres (N, 3) and viewing axes (N, 3) of a scene's camera."""
    poses = build_motion(SCENES[name], np.random.default_rng(0)).poses(t_s)
    return poses[:, :3, 3], poses[:, :3, 2]


def test_a_drone_rises_before_it_flies_off_and_looks_down() -> None:
    centre, ahead = positions_and_axes("drone", np.array([0.0, 4.0, 6.0, 20.0]))
    assert np.hypot(*(centre[1] - centre[0])[:2]) < 0.1 and centre[1, 2] - centre[0, 2] > 4.0
    assert centre[2, 2] == pytest.approx(10.0, abs=0.1)
    assert np.hypot(*(centre[3] - centre[2])[:2]) > 40.0
    assert np.degrees(np.arcsin(ahead[:, 2])) == pytest.approx(-30.0, abs=1.6)


def test_an_orbit_looks_at_what_it_circles() -> None:
    centre, ahead = positions_and_axes("orbit", np.linspace(0.0, 29.0, 30))
    inwards = np.array([0.0, 15.0]) - centre[:, :2]
    assert np.linalg.norm(inwards, axis=1) == pytest.approx(15.0, abs=0.05)
    off = (inwards[:, 0] * ahead[:, 1] - inwards[:, 1] * ahead[:, 0]) / 15.0
    assert np.degrees(np.arcsin(np.abs(off).max())) < 5.0
    assert np.linalg.norm(np.diff(centre[:, :2], axis=0), axis=1) == pytest.approx(1.5, rel=0.01)
