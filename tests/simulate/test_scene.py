from pathlib import Path

import pytest

from vgps.errors import ConfigError
from vgps.simulate.scene import SCENES, scene_config, scene_with_errors


@pytest.mark.parametrize("name", SCENES)
def test_the_last_speed_knot_is_a_frame_after_the_last_frame(name: str) -> None:
    scene = scene_config(name)
    assert scene.duration_s + 1 / scene.fps == pytest.approx(scene.speed[-1][0])


def test_unknown_scenes_and_references_without_a_log_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"unknown scene 'moon'; expected one of walk, drive, demo, spin"):
        scene_config("moon")
    with pytest.raises(ConfigError, match="a reference without a log of errors"):
        scene_with_errors("walk", reference=Path("better.pos"))
    assert scene_with_errors("walk") is SCENES["walk"]
