import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.online.sources.gps_messages import Epochs, messages
from vgps.readers.gps_formats.fixes import Clock
from vgps.readers.gps_formats.nmea import read_nmea
from vgps.readers.gps_formats.ubx import read_ubx

EPOCHS = [
    b"$GNRMC,235959.00,A,4900.6599756,N,00824.9900171,E,0.1,,260911,,,A",
    b"$GNGGA,235959.00,4900.6599756,N,00824.9900171,E,4,14,0.80,116.0689,M,47.9,M,1.0,0000",
    b"$GNGST,235959.00,,,,,0.010,0.011,0.015",
    b"$GNGGA,000000.00,4900.6640753,N,00824.9946148,E,5,14,0.80,116.2193,M,47.9,M,1.0,0000",
    b"$GNGST,000000.00,,,,,0.500,0.500,1.000",
]


def fixes_in(data):
    """Return the fixes in a complete stream."""
    epochs = Epochs()
    found = [fix for raw in messages(io.BytesIO(data)) for fix in epochs.add(raw)]
    return found + epochs.flush()


def checked(sentence: bytes) -> bytes:
    total = 0
    for byte in sentence[1:]:
        total ^= byte
    return sentence + b"*%02X\r\n" % total


LOG = b"".join(map(checked, EPOCHS))


def rows(fixes):
    return np.array([[*fix[:4], *fix.sigma_m, fix.hdop, fix.satellites] for fix in fixes])


def test_epochs_equal_the_log_reader_s_fixes_over_midnight_too():
    found, log = fixes_in(LOG), read_nmea(LOG)
    assert [fix.clock for fix in found] == [Clock.UTC, Clock.UTC]
    np.testing.assert_array_equal(rows([fix.fix for fix in found]), rows(log.fixes))
    assert found[1].fix.t_s - found[0].fix.t_s == pytest.approx(1.0)
    assert [fix.fix.fix_class for fix in found] == ["rtk_fix", "rtk_float"]


def test_a_fix_is_returned_by_the_next_epoch_or_by_flush():
    epochs = Epochs()
    given_at = [len(epochs.add(checked(sentence))) for sentence in EPOCHS]
    assert given_at == [0, 0, 0, 1, 0]
    assert len(epochs.flush()) == 1 and epochs.flush() == []


def flat(count: int) -> list[bytes]:
    """Return epochs of RMC alone, a second apart, at noon."""
    return [
        checked(b"$GNRMC,1200%02d.00,A,4900.66,N,00824.99,E,0.1,,260911,,,A" % second)
        for second in range(count)
    ]


def test_rmc_is_a_fix_when_for_seconds_no_heights_came():
    epochs = Epochs()
    found = [fix.fix for raw in flat(6) for fix in epochs.add(raw)] + [fix.fix for fix in epochs.flush()]
    assert [fix.t_s % 60 for fix in found] == [3, 4, 5]
    assert [fix.height_m for fix in found] == [0.0] * 3
    assert epochs.notes[0] == "no GGA with a fix: positions are those of RMC" and len(epochs.notes) == 2


def test_rmc_is_no_fix_of_a_receiver_that_sends_heights():
    gga = checked(b"$GNGGA,115959.00,4900.6599756,N,00824.9900171,E,4,14,0.80,116.0689,M,47.9,M,1.0,0000")
    found = fixes_in(b"".join([*flat(2), gga, *flat(30)]))
    assert [fix.fix.fix_class for fix in found] == ["rtk_fix"]


def test_the_sentence_of_the_last_date_is_no_second_fix():
    gll = checked(b"$GNGLL,4900.66,N,00824.99,E,120010.00,A,A")
    found = [fix.fix for fix in fixes_in(b"".join([*flat(6), gll]))]
    assert [fix.t_s % 60 for fix in found] == [3, 4, 5]  # RMC is preferred, as in a log


def test_gll_alone_is_read():
    gll = b"$GNGLL,4900.66,N,00824.99,E,1200%02d.00,A,A"
    found = fixes_in(b"".join(checked(gll % second) for second in range(5)))
    assert [fix.fix.t_s for fix in found] == [43203.0, 43204.0] and found[0].clock is Clock.TIME_OF_DAY


def test_without_a_date_only_the_time_of_day_is_known():
    found = fixes_in(checked(EPOCHS[1]))
    assert found[0].clock is Clock.TIME_OF_DAY and found[0].fix.t_s == 86399.0


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 5), st.binary(max_size=30)), max_size=6))
def test_noise_between_sentences_costs_no_fix_before_it_and_never_an_error(noise):
    parts = [checked(sentence) for sentence in EPOCHS]
    for at, data in noise:
        parts.insert(at, data.replace(b"$", b"-").replace(b"\xb5", b"-").replace(b"\xd3", b"-") + b"\r\n")
    np.testing.assert_array_equal(
        rows([fix.fix for fix in fixes_in(b"".join(parts))]), rows(read_nmea(LOG).fixes)
    )


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(st.binary(max_size=200), st.integers(0, len(LOG)))
def test_any_bytes_are_survived(data, cut):
    for fix in fixes_in(LOG[:cut] + data + LOG[cut:]):
        assert np.isfinite(fix.fix.t_s)


@pytest.mark.slow
def test_a_mixed_ubx_log_gives_what_the_log_reader_gives(data_dir):
    data = (data_dir / "rtk_walk/gnss.ubx").read_bytes()
    found, log = [fix.fix for fix in fixes_in(data)], read_ubx(data)
    assert len(found) == len(log.fixes) == 536
    np.testing.assert_array_equal(rows(found), rows(log.fixes))
    assert [fix.fix_class for fix in found] == [fix.fix_class for fix in log.fixes]


def test_messages_end_with_the_stream():
    assert len(list(messages(io.BytesIO(LOG + b"$GNGGA,1")))) >= 5
