from dataclasses import replace

import numpy as np
import pytest
import yaml

from vgps.errors import ConfigError
from vgps.readers.recording import open_recording
from vgps.readers.views.lenses import Equirectangular, WideFisheye, wide_fisheye
from vgps.readers.views.view import views_of
from vgps.simulate import SCENES, Renderer, build_motion, build_world, simulate
from vgps.simulate.panorama import PanoramaRenderer
from vgps.simulate.recording import _camera

SCENE = replace(
    SCENES["demo"], speed=((0.0, 1.2), (0.4, 1.2)), fps=5, texture_scale=0.25, noise_levels=0.0, max_samples=1
)
SPHERE = replace(SCENE, width=628, height=314, panorama_deg=360.0)
CIRCLE = replace(SCENE, width=340, height=340, panorama_deg=195.0)


@pytest.mark.slow
@pytest.mark.parametrize("scene", [SPHERE, CIRCLE], ids=["sphere", "circle"])
def test_its_view_ahead_is_what_a_pinhole_shows(scene):
    motion = build_motion(scene, np.random.default_rng(0))
    world = build_world(scene, np.random.default_rng(1))
    wide = PanoramaRenderer(world, motion, scene).frame(0)
    lens: Equirectangular | WideFisheye | None = Equirectangular(scene.width, scene.height)
    if scene is CIRCLE:
        lens = wide_fisheye(_camera(scene))
    assert lens is not None
    view = views_of(lens)[0]
    size = view.camera.width
    flat = replace(scene, panorama_deg=0.0, width=size, height=size, focal_px=view.camera.fx)
    expected = Renderer(world, motion, flat).frame(0)
    difference = np.abs(view.picture(wide).astype(float) - expected)
    turned = np.abs(view.picture(wide)[:, ::-1].astype(float) - expected)
    assert np.median(difference) <= 2.0 and difference.mean() < 0.3 * turned.mean()
    if scene is CIRCLE:
        assert not wide[0, 0].any()  # outside the circle


@pytest.mark.slow
def test_the_files_are_those_of_a_recording(tmp_path):
    simulate(tmp_path / "walk", replace(SPHERE, width=128, height=64))
    text = (tmp_path / "walk" / "camera.yaml").read_text()
    assert yaml.safe_load(text) == {"model": "equirectangular", "width": 128, "height": 64}
    assert len(open_recording(tmp_path / "walk").cameras) == 3


@pytest.mark.parametrize(
    "change",
    [
        {"panorama_deg": 90.0},
        {"width": 600},
        {"width": 627, "panorama_deg": 195.0},
        {"readout_s": 0.01},
        {"cameras": 2},
        {"fisheye_deg": 120.0},
    ],
)
def test_what_cannot_be_rendered_is_refused(tmp_path, change):
    with pytest.raises(ConfigError, match=r"panorama_deg|width, height: a picture of 627"):
        simulate(tmp_path / "walk", replace(SPHERE, **change))
