"""Damaged files are read or refused in one line, and the fuzzer notices everything else."""

import faulthandler
import os
import shutil
import time
from dataclasses import replace

import pytest

from scripts.experiments.fuzz import campaign
from scripts.experiments.fuzz.campaign import damaged, fuzz
from scripts.experiments.fuzz.mutators import damage_bytes
from scripts.experiments.fuzz.targets import TARGETS, Target
from vgps.errors import VgpsError

NAMES = [target.name for target in TARGETS]
# of 20 to 150 ms a file; in .github/workflows/checks.yml every reader gets a thousand at each push
FEW = {
    "bag",
    "pos",
    "ros2",
    "ros2_metadata",
    "run_arrays",
    "run_config",
    "sbf",
    "settings",
    "telemetry",
    "ubx",
    "whole_arrays",
}


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS, ids=NAMES)
def test_the_corpus_is_read_or_refused_in_one_line(target, tmp_path):
    for file in target.seeds():
        folder = tmp_path / file.name
        folder.mkdir()
        for beside in target.companions():
            shutil.copy(beside, folder)
        copy = shutil.copy(file, folder / (target.file or file.name))
        try:
            target.read(copy)
        except VgpsError as error:
            assert "finding" in file.name, error  # the others are whole
            assert len(str(error)) < campaign.LONGEST_MESSAGE and str(error).isprintable()


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS, ids=NAMES)
def test_damaged_files_of_every_reader(target):
    """A campaign damages many more: ``python -m scripts.experiments.fuzz``."""
    count = 5 if target.name in FEW else 15
    tally = fuzz(target, range(count), seed=23)
    assert tally.findings == [] and tally.inputs == count
    assert tally.refused + tally.accepted == count


def test_a_damaged_file_can_be_made_again():
    for target in TARGETS:
        assert damaged(target, 1, 7) == damaged(target, 1, 7)
        assert damaged(target, 1, 7) != damaged(target, 2, 7)


def fails(path):
    raise ZeroDivisionError("by\nzero")


def refuses_at_length(path):
    raise VgpsError("no", file="a" * 3000)


def dies(path):
    faulthandler.disable()  # pytest's, whose traceback would read like a failure
    os.abort()


def spins(path):
    while True:
        pass


def waits(path):
    time.sleep(60)


def grows(path):
    bytearray(300 * 2**20)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("read", "kind"),
    [
        (fails, "traceback"),
        (refuses_at_length, "message"),
        (dies, "crash"),
        (spins, "slow"),
        (waits, "hang"),
        (grows, "memory"),
    ],
)
def test_every_kind_of_finding_is_noticed(monkeypatch, tmp_path, read, kind):
    monkeypatch.setattr(campaign, "LONGEST_S", 0.05 if kind == "slow" else 10.0)
    monkeypatch.setattr(campaign, "STUCK_S", 1.0 if kind == "hang" else 30.0)
    monkeypatch.setattr(campaign, "LARGEST_MB", 300.0 if kind == "memory" else 1e6)
    target = Target(name=kind, read=read, mutators=(damage_bytes,), corpus="trajectory")
    tally = fuzz(target, range(2), seed=0, kept=tmp_path)
    assert [(finding.kind, finding.number) for finding in tally.findings] == [(kind, 0), (kind, 1)]
    assert tally.inputs == 2
    assert len(list((tmp_path / kind).glob(f"{kind}-0-*"))) == 2


def test_what_is_read_and_what_is_refused_is_counted():
    (trajectory,) = (target for target in TARGETS if target.name == "trajectory")
    tally = fuzz(replace(trajectory, mutators=(lambda data, rng: data,)), range(5), seed=0)
    assert (tally.inputs, tally.accepted, tally.refused) == (5, 5, 0)
