"""Verbs that take one camera refuse a rig of several in one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from clips import write_clip


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    folder = tmp_path / "rig"
    folder.mkdir()
    for name in ("video", "rear"):
        write_clip(folder / f"{name}.mp4", frames=4)
    lens = {"model": "pinhole", "width": 64, "height": 48, "fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5}
    (folder / "camera.yaml").write_text(yaml.safe_dump(lens))
    rear = {"name": "rear", "video": "rear.mp4", "reference_R_camera": np.diag([-1, 1, -1]).tolist()}
    (folder / "rig.yaml").write_text(yaml.safe_dump({"cameras": [rear]}))
    return folder


@pytest.mark.parametrize("words", [("online",), ("track", "--landmarks", "street.vgps")])
def test_a_rig_is_refused(vgps_verb, rig: Path, words: tuple[str, ...]) -> None:
    verb, *options = words
    code, out, err = vgps_verb(verb, rig, *options, "--out", rig.parent / "run")
    assert (code, out) == (2, "")
    assert err == (
        f"vgps: {rig}: a rig of 2 cameras; expected one camera, as vgps {verb} takes it; "
        "name a rig.yaml without the key cameras: --rig FILE\n"
    )
    assert [path.name for path in rig.parent.iterdir()] == ["rig"]


def test_smooth_refuses_to_refine_the_lenses_of_a_rig(vgps_verb, rig: Path) -> None:
    settings = rig.parent / "settings.yaml"
    settings.write_text("intrinsics: {refine: yes}\n")
    code, _, err = vgps_verb("smooth", rig, "--config", settings, "--out", rig.parent / "run")
    assert code == 2 and err.count("\n") == 1
    assert "key intrinsics.refine: yes, with a rig of several cameras" in err
