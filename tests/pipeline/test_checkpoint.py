"""A run that goes on from a checkpoint is the run that was never interrupted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fewer_features import fewer_features
from run_files import bytes_of

import vgps
from vgps.errors import RunFolderError
from vgps.pipeline import checkpoint as module
from vgps.pipeline.checkpoint import Checkpoint, checkpoint_folder, fingerprint
from vgps.pipeline.front_end import run_front_end
from vgps.readers.video.masks import MaskFolder
from vgps.runtime import journal
from vgps.runtime.progress import NoProgress
from vgps.smoothing.stage_d import long_steps

pytestmark = pytest.mark.slow
CONFIG = fewer_features(150)


class Stops(NoProgress):
    """Ends a run after a number of frames."""

    def __init__(self, frames):
        self.frames = frames

    def track(self, frames, total):
        for frame in frames:
            if frame.index == self.frames:
                raise KeyboardInterrupt
            yield frame


@pytest.fixture
def opened(brief, monkeypatch):
    monkeypatch.setattr(module, "EVERY_S", 0.0)
    monkeypatch.setattr(module, "_SHARE", 1e9)
    return vgps.open_recording(brief)


def files(folder):
    found = bytes_of(folder)
    del found["solution.json"]  # its seconds vary
    return found


@pytest.fixture(scope="module")
def whole(brief, tmp_path_factory):
    """The files of a run that was never interrupted, and how often its stage D solved."""
    out, solved, solve = tmp_path_factory.mktemp("whole") / "run", [], long_steps.solve
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(long_steps, "solve", lambda *given: solved.append(given) or solve(*given))
        vgps.write_run(vgps.smooth(vgps.open_recording(brief), CONFIG), out)
    return files(out), len(solved)


@pytest.mark.parametrize("frames", [1, 36])
def test_the_resumed_run_has_the_same_bytes(opened, whole, tmp_path, frames):
    config, out = CONFIG, tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        vgps.smooth(opened, config, Stops(frames), Checkpoint(out, opened, config, resume=True))
    again = Checkpoint(out, opened, config, resume=True)
    vgps.write_run(vgps.smooth(opened, config, None, again), out)
    again.remove()
    assert files(out) == whole[0]
    assert not checkpoint_folder(out).exists()


def test_a_run_that_a_probe_stopped_stops_again_when_resumed(opened, tmp_path):
    config, probe = CONFIG, SimpleNamespace(stops=lambda frames, _: frames == 20)
    for resume in (False, True):
        checkpoint = Checkpoint(tmp_path / "run", opened, config, resume=resume)
        assert len(run_front_end(opened, config, NoProgress(), checkpoint, probe).t_s) == 20


def test_stage_d_goes_on_at_its_last_round(opened, whole, tmp_path, monkeypatch):
    config, out, counts, at_most = CONFIG, tmp_path / "run", [], [1, 2, np.inf]
    monkeypatch.setattr(journal, "_WORTH_S", 0.0)
    solve = long_steps.solve

    def counting(*given):
        if counts[-1] == at_most[len(counts) - 1]:
            raise KeyboardInterrupt
        counts[-1] += 1
        return solve(*given)

    def run(*, resume):
        counts.append(0)
        vgps.write_run(vgps.smooth(opened, config, None, Checkpoint(out, opened, config, resume=resume)), out)

    monkeypatch.setattr(long_steps, "solve", counting)
    for resume in (False, True):
        with pytest.raises(KeyboardInterrupt):
            run(resume=resume)
    run(resume=True)
    assert counts[:2] == [1, 2] and (files(out), sum(counts)) == whole


def test_a_checkpoint_of_another_run_is_refused(opened, tmp_path):
    config, out = CONFIG, tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run_front_end(opened, config, Stops(2), Checkpoint(out, opened, config, resume=False))
    other = CONFIG.model_copy(update={"seed": 1})
    with pytest.raises(RunFolderError, match="another recording, configuration or version"):
        run_front_end(opened, other, NoProgress(), Checkpoint(out, opened, other, resume=True))
    with pytest.raises(KeyboardInterrupt):
        run_front_end(opened, other, Stops(2), Checkpoint(out, opened, other, resume=False))


def test_sigmas_of_fixes_and_the_version_of_vgps_make_another_run(opened, monkeypatch):
    config = CONFIG
    before = fingerprint(opened, config)
    assert fingerprint(opened, config) == before
    less_accurate = replace(opened, gps=replace(opened.gps, sigma_m=opened.gps.sigma_m + 1.0))
    assert fingerprint(less_accurate, config) != before
    monkeypatch.setattr(module, "version", lambda _: "0.0.0")
    assert fingerprint(opened, config) != before


def test_other_masks_make_another_run(opened, tmp_path):
    (tmp_path / "000001.png").write_bytes(b"a")
    masked = replace(opened, masks=MaskFolder(tmp_path, opened.video))
    before = fingerprint(masked, CONFIG)
    assert before not in (
        fingerprint(opened, CONFIG),
        fingerprint(masked, CONFIG.model_copy(update={"seed": 1})),
    )
    (tmp_path / "000001.png").write_bytes(b"another")
    assert fingerprint(masked, CONFIG) != before
