"""Dataflash messages: those of pymavlink, its own reader."""

import pytest
from log_bytes import FIX, dataflash

from vgps.readers.gps_formats.dataflash import dataflash_messages


def test_messages_are_those_of_pymavlink(tmp_path):
    reader = pytest.importorskip("pymavlink.DFReader")
    file = tmp_path / "a.bin"
    file.write_bytes(dataflash())
    log = reader.DFReader_binary(str(file))
    for own in dataflash_messages(file.read_bytes(), "GPS"):
        theirs = log.recv_match(type=["GPS"])
        for name in ("Status", "GMS", "GWk", "NSats", "HDop", "Lat", "Lng", "Alt"):
            assert getattr(own, name) == pytest.approx(getattr(theirs, name), abs=1e-9)
    log.close()


def test_a_damaged_stretch_is_passed_over():
    whole = dataflash()
    cut = whole.replace(b"\xa3\x95\x82", b"\xa3\x95\x99", 1)
    assert len(list(dataflash_messages(whole, "GPS"))) == len(FIX)
    assert len(list(dataflash_messages(cut, "GPS"))) == len(FIX) - 1


def test_a_description_that_does_not_fit_gives_nothing():
    assert list(dataflash_messages(dataflash().replace(b"QBBIHBc", b"QBBIHBd"), "GPS")) == []
