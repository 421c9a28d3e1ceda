"""What GoPros state of their lenses: made settings, and two real recordings."""

from dataclasses import replace

import numpy as np
import pytest
from gpmf_bytes import device, encode, text

from vgps.camera import centred_camera, project, row_shares
from vgps.readers.gopro import lens
from vgps.readers.gopro.gpmf import Block, Telemetry, read_gpmf
from vgps.readers.gopro.lens import gopro_guess, gopro_readout_s, gopro_settings, with_readout

SIZE = (1920, 1080)
CORNER_PX = float(np.hypot(*SIZE)) / 2
# the numbers of gpmf-parser's issue 196, a HERO12
POLY = [0.0, 1.8229533, 0.1068096, -0.6631866, 0.3563110, 0.0, 0.0]
ZMPL = 0.6549


@pytest.fixture
def guess(monkeypatch, tmp_path):
    """Guess from the given entries of a header."""

    def guess(*entries, size=SIZE):
        payload = device("Global Settings", text("MINF", "HERO12 Black"), *entries)
        monkeypatch.setattr(lens, "read_box", lambda *names: payload)
        return gopro_guess(Telemetry(tmp_path / "GX010042.MP4"), size)

    return guess


def corner_deg(camera):
    """Return the angle from the axis whose ray meets the corner of the picture."""
    angle = np.radians(np.linspace(1, 80, 2000))
    ray = np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    return float(np.degrees(np.interp(CORNER_PX, project(camera, ray)[:, 0] - camera.cx, angle)))


def test_the_stated_lens_is_followed_to_the_corner(guess):
    found = guess(text("VFOV", "W"), encode("ZMPL", "f", [[ZMPL]]), encode("POLY", "f", [POLY]))
    assert found.camera.model == "fisheye"
    assert corner_deg(found.camera) == pytest.approx(np.degrees(np.polyval(POLY[::-1], ZMPL)), rel=0.01)
    assert found.source == "a GoPro (HERO12 Black), set to wide, with the lens that it states"


def test_the_stated_angle_fills_the_diagonal(guess):
    found = guess(text("VFOV", "W"), encode("ZFOV", "f", [[120.0]]))
    assert corner_deg(found.camera) == pytest.approx(60.0, rel=0.002)
    linear = guess(text("VFOV", "L"), encode("ZFOV", "f", [[90.0]]))
    assert linear.camera.model == "opencv"
    assert linear.camera.fx == pytest.approx(CORNER_PX)


def test_older_models_have_the_angles_of_the_tables(guess):
    wide, narrow = guess(text("VFOV", "W")), guess(text("VFOV", "N"))
    assert "118.2 degrees wide by GoPro's tables" in wide.source
    assert narrow.camera.fx > 1.7 * wide.camera.fx
    steady = guess(text("VFOV", "W"), text("EISE", "Y"))
    assert steady.camera.fx == pytest.approx(wide.camera.fx / 0.9, rel=0.02)
    assert "stabilisation" in steady.source
    high = guess(text("VFOV", "W"), size=(1440, 1080))
    assert high.camera.fx / 1440 < wide.camera.fx / 1920
    assert guess().focal_sigma > wide.focal_sigma


def test_a_stretched_picture_is_told(guess):
    found = guess(text("VFOV", "S"), encode("ZMPL", "f", [[ZMPL]]), encode("POLY", "f", [POLY]))
    assert "stretches the picture unevenly" in found.source


def test_other_videos_and_damaged_headers_are_no_gopros(guess, monkeypatch, tmp_path):
    for data in (None, b"DEVC\0\x01\xff\xff"):
        monkeypatch.setattr(lens, "read_box", lambda *names, data=data: data)
        assert gopro_guess(Telemetry(tmp_path / "a.mp4"), SIZE) is None


def test_real_headers_tell_the_angle_of_the_lens(data_dir):
    gopro_walk, gopro_hero7 = (data_dir / name / "video.mp4" for name in ("gopro_walk", "gopro_hero7"))
    settings = gopro_settings(gopro_walk)
    assert settings["ZFOV"].kind == "f" and settings["VFOV"].data == b"W"
    walk = gopro_guess(read_gpmf(gopro_walk), (848, 480))
    assert walk.source.startswith("a GoPro (Max), set to wide, with the angle of 137 degrees")
    hero7 = gopro_guess(read_gpmf(gopro_hero7), (848, 480))
    assert hero7.source.startswith(
        "a GoPro (Hero7 Black), set to wide, 118.2 degrees wide by GoPro's tables less"
    )


@pytest.mark.parametrize(("stabilised", "expected"), [("N", 0.008), ("Y", None), (None, None)])
def test_the_readout_counts_where_the_pictures_are_not_stabilised(
    monkeypatch, tmp_path, stabilised, expected
):
    payload = device("Global Settings", *([text("EISE", stabilised)] if stabilised else []))
    monkeypatch.setattr(lens, "read_box", lambda *names: payload)
    blocks = [Block(stamp_s=0.0, samples=np.full((30, 1), value)) for value in (8.0, 8.0, 8.1)]
    telemetry = Telemetry(tmp_path / "GH010042.MP4", sensors={"SROT": blocks})
    assert gopro_readout_s(telemetry) == pytest.approx(expected)
    assert gopro_readout_s(replace(telemetry, sensors={})) is None


@pytest.mark.parametrize(
    ("turns", "axis", "expected"),
    [(0, "rows", 0.008), (1, "columns", 0.008), (2, "rows", -0.008), (3, "columns", -0.008)],
)
def test_the_readout_turns_with_the_picture(monkeypatch, tmp_path, turns, axis, expected):
    monkeypatch.setattr(lens, "read_box", lambda *names: device("Global Settings", text("EISE", "N")))
    blocks = [Block(stamp_s=0.0, samples=np.full((30, 1), 8.0))]
    telemetry = Telemetry(tmp_path / "GH010042.MP4", sensors={"SROT": blocks})
    size = (640, 480) if turns % 2 == 0 else (480, 640)
    camera = with_readout(centred_camera("opencv", size, 500.0), telemetry, turns)
    assert camera.readout_axis == axis and camera.readout_s == pytest.approx(expected)
    sensor_rows = np.tile(np.arange(480.0)[:, None], (1, 640))
    v, u = (index.ravel()[::997] for index in np.indices(size[::-1]))
    share = row_shares(camera, np.column_stack([u, v]).astype(float)) * np.sign(expected)
    np.testing.assert_allclose(share, np.rot90(sensor_rows, turns)[v, u] / 479 - 0.5, atol=1e-12)
    given = with_readout(replace(camera, readout_s=0.02, readout_axis="rows"), telemetry, turns)
    assert given.readout_s == 0.02 and given.readout_axis == axis


def test_the_readout_of_a_stabilised_hero7_is_not_used(data_dir):
    assert gopro_readout_s(read_gpmf(data_dir / "gopro_hero7/video.mp4")) is None
