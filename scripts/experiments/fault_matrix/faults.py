"""Faults of a GPS receiver, put into a good log: outliers, outages, a late clock, lever arms, biases."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vgps.errors import GpsLogError
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import BoolArray, FixClass, FloatArray, GeodeticPoint, GpsLog, Recording
from vgps.readers.gps_formats.fixes import counted
from vgps.simulate.sensor_config import FIX_ERRORS, FixErrors
from vgps.simulate.sensors import unit_gauss_markov

_LEAST_FIXES = 3  # that an outage must leave before it and after it
_OUTLIER_M = (8.0, 40.0)
_CLUSTER_M = 15.0


@dataclass(frozen=True)
class Faulty:
    """A recording with a fault; ``wrong`` (M,) marks the fixes that are not what their class says."""

    recording: Recording
    wrong: BoolArray


Inject = Callable[[Recording, GpsLog, np.random.Generator], Faulty]


@dataclass(frozen=True)
class Fault:
    """A fault: its short name, and a description for people."""

    name: str
    description: str
    inject: Inject

    def into(self, recording: Recording, rng: np.random.Generator) -> Faulty:
        """Return the recording with this fault.

        Raises:
            GpsLogError: The recording has no log, or one too short for the fault.
        """
        if recording.gps is None:
            raise GpsLogError(
                "no GPS log to put faults into", file=recording.path, remedy="name one with --gps"
            )
        return self.inject(recording, recording.gps, rng)


def none(recording: Recording, log: GpsLog, rng: np.random.Generator) -> Faulty:
    """Leave the log as it is."""
    return Faulty(recording, np.zeros(len(log), dtype=bool))


def outliers(share: float, recording: Recording, log: GpsLog, rng: np.random.Generator) -> Faulty:
    """Move a share of the fixes, each by 8 to 40 m in the plane and 10 m (sigma) in height."""
    inside = np.flatnonzero(_inside(recording, log))
    rows = rng.permutation(inside)[: round(share * len(inside))]
    angle, far = rng.uniform(0, 2 * np.pi, len(rows)), rng.uniform(*_OUTLIER_M, len(rows))
    offset = np.zeros((len(log), 3))
    offset[rows] = np.column_stack([far * np.cos(angle), far * np.sin(angle), rng.normal(0, 10.0, len(rows))])
    return Faulty(_moved(recording, log, offset), np.any(offset, axis=1))


def cluster(
    count: int, at_start: bool, recording: Recording, log: GpsLog, rng: np.random.Generator
) -> Faulty:
    """Move consecutive fixes, the first or the middle ones, by the same 15 m, and label them RTK-fix."""
    inside = _inside(recording, log)
    rows = inside & (np.cumsum(inside) <= count) if at_start else _middle(recording, log, count)
    angle = rng.uniform(0, 2 * np.pi)
    offset = np.zeros((len(log), 3))
    offset[rows] = _CLUSTER_M * np.array([np.cos(angle), np.sin(angle), 0.3])
    log = _labelled(log, rows, FixClass.RTK_FIX)
    return Faulty(_moved(recording, log, offset), rows)


def outage(seconds: float, recording: Recording, log: GpsLog, rng: np.random.Generator) -> Faulty:
    """Remove the fixes of so many seconds in the middle of the video."""
    middle_s = 0.5 * float(recording.video.times_s[-1])
    kept = np.abs(log.t_s - middle_s) > 0.5 * seconds
    inside = kept & _inside(recording, log)
    sides = [int((inside & side).sum()) for side in (log.t_s < middle_s, log.t_s > middle_s)]
    if min(sides) < _LEAST_FIXES:
        raise GpsLogError(
            f"an outage of {seconds:g} s leaves {counted(sides[0], 'fix')} before it and {sides[1]} after it",
            file=log.source,
            expected=f"at least {_LEAST_FIXES} on either side",
        )
    fewer = log.rows(kept)
    return Faulty(replace(recording, gps=fewer), np.zeros(len(fewer), dtype=bool))


def late(seconds: float, recording: Recording, log: GpsLog, rng: np.random.Generator) -> Faulty:
    """Make positions so many seconds older than their time stamps say."""
    return none(replace(recording, gps=replace(log, t_s=log.t_s + seconds)), log, rng)


def lever_arm(offset_m: FloatArray, recording: Recording, log: GpsLog, rng: np.random.Generator) -> Faulty:
    """Move the antenna of ``rig.yaml`` by (3,) metres in the camera frame."""
    rig = replace(recording.rig, camera_p_antenna=recording.rig.camera_p_antenna + offset_m)
    return none(replace(recording, rig=rig), log, rng)


def bias(
    share: float, offset_m: FloatArray, recording: Recording, log: GpsLog, rng: np.random.Generator
) -> Faulty:
    """Move a share of the fixes, the middle ones, by (3,) metres; those labelled RTK-fix are then wrong."""
    middle = _middle(recording, log, int(share * _inside(recording, log).sum()))
    fixed = np.array([name is FixClass.RTK_FIX for name in log.fix_class], dtype=bool)
    return Faulty(_moved(recording, log, middle[:, None] * offset_m), middle & fixed)


def float_drift(errors: FixErrors, recording: Recording, log: GpsLog, rng: np.random.Generator) -> Faulty:
    """Label all but the first and last tenth RTK-float, and let them wander as a float solution does."""
    middle = _middle(recording, log, int(0.8 * _inside(recording, log).sum()))
    rows = np.flatnonzero(middle)
    offset = np.zeros((len(log), 3))
    offset[rows] = np.array(errors.total_m) * unit_gauss_markov(log.t_s[rows], errors.correlation_s, rng)
    log = _labelled(log, middle, FixClass.RTK_FLOAT)
    sigma_m = np.where(middle[:, None], errors.reported_m, log.sigma_m)
    return Faulty(_moved(recording, replace(log, sigma_m=sigma_m), offset), np.zeros(len(log), dtype=bool))


FAULTS = (
    Fault("none", "the log as it is", none),
    *(
        Fault(f"outliers-{share}", f"{share} % of the fixes 8 to 40 m off", partial(outliers, share / 100))
        for share in (10, 20, 30, 40)
    ),
    Fault("cluster", "8 fixes in a row off by the same 15 m, labelled RTK-fix", partial(cluster, 8, False)),
    Fault("start", "the first 8 fixes off by the same 15 m, labelled RTK-fix", partial(cluster, 8, True)),
    *(Fault(f"outage-{s}", f"no fixes for {s} s", partial(outage, float(s))) for s in (10, 30, 60)),
    Fault("late", "positions 0.5 s older than their stamps", partial(late, 0.5)),
    Fault(
        "lever-arm", "antenna 0.7 m from where rig.yaml has it", partial(lever_arm, np.array([0.5, 0, 0.5]))
    ),
    Fault(
        "vertical-bias",
        "the middle half of the fixes 4 m too high",
        partial(bias, 0.5, np.array([0, 0, 4.0])),
    ),
    Fault(
        "wrong-integers",
        "the middle two fifths of the fixes off by 0.36 m in the plane and 0.4 m in height",
        partial(bias, 0.4, np.array([0.3, -0.2, 0.4])),
    ),
    Fault(
        "float-drift",
        "four fifths of the fixes RTK-float, wandering (sigma 0.87 m in the plane, 2.5 m in height)",
        partial(float_drift, FIX_ERRORS[FixClass.RTK_FLOAT]),
    ),
)


def _inside(recording: Recording, log: GpsLog) -> BoolArray:
    return np.asarray((log.t_s >= 0.0) & (log.t_s <= recording.video.times_s[-1]))


def _middle(recording: Recording, log: GpsLog, count: int) -> BoolArray:
    """Return (M,) the ``count`` fixes in the middle of the video."""
    inside = np.flatnonzero(_inside(recording, log))
    begin = (len(inside) - count) // 2
    if begin < 1:
        raise GpsLogError(
            f"{len(inside)} fixes during the video", file=log.source, expected=f"at least {count + 2}"
        )
    out = np.zeros(len(log), dtype=bool)
    out[inside[begin : begin + count]] = True
    return out


def _moved(recording: Recording, log: GpsLog, offset_m: FloatArray) -> Recording:
    """Move fixes by (M, 3) metres east, north, up; those without an offset stay exactly where they are."""
    rows = np.flatnonzero(offset_m.any(axis=1) & np.isfinite(log.latitude_deg))
    if not len(rows):
        return replace(recording, gps=log)
    places = np.stack([log.latitude_deg, log.longitude_deg, log.height_m], axis=1)
    origin = recording.rig.world_origin or GeodeticPoint(*(float(x) for x in places[rows[0]]))
    places[rows] = to_geodetic(origin, to_enu(origin, *places[rows].T) + offset_m[rows])
    moved = replace(log, latitude_deg=places[:, 0], longitude_deg=places[:, 1], height_m=places[:, 2])
    return replace(recording, gps=moved)


def _labelled(log: GpsLog, rows: BoolArray, name: FixClass) -> GpsLog:
    classes = tuple(name if row else own for row, own in zip(rows, log.fix_class, strict=True))
    return replace(log, fix_class=classes)
