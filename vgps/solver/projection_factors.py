"""The projection factors of a GTSAM graph as arrays, and which of them the engine can take."""

from collections import Counter
from typing import Any, NamedTuple

import gtsam
import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solver.noise_models import Noise, read_noise

Calibration = tuple[float, float, float, float, float]  # fx, fy, skew, cx, cy


class ProjectionFactors(NamedTuple):
    """Projection factors of a graph.

    Attributes:
        place: (N,) of the factors in the graph.
        pose, point: (N,) keys.
        noise, camera: (N,) numbers among the graph's noise models and calibrations.
        uv_px: (N, 2).
    """

    place: IntArray
    pose: IntArray
    point: IntArray
    noise: IntArray
    camera: IntArray
    uv_px: FloatArray

    def only(self, kept: BoolArray) -> "ProjectionFactors":
        """Those of (N,) that are kept."""
        numbers = self.place, self.pose, self.point, self.noise, self.camera
        place, pose, point, noise, camera = (column[kept] for column in numbers)
        return ProjectionFactors(place, pose, point, noise, camera, self.uv_px[kept])


def sorted_out(
    graph: gtsam.NonlinearFactorGraph,
) -> tuple[ProjectionFactors, list[Noise | None], list[Calibration], list[int]]:
    """The projections, the graph's noise models and calibrations, and the places of all other factors."""
    rows, uv_px, others = [], [], []
    # GTSAM hands out one object for one model as long as it lives: each is read once
    models: dict[int, tuple[int, gtsam.noiseModel.Base]] = {}
    cameras: dict[int, tuple[int, gtsam.Cal3_S2]] = {}
    for at in range(graph.size()):
        factor = graph.at(at)
        if factor is None:
            continue
        if type(factor) is not gtsam.GenericProjectionFactorCal3_S2 or factor.throwCheirality():
            others.append(at)
            continue
        model, K = factor.noiseModel(), factor.calibration()
        number = models.setdefault(id(model), (len(models), model))[0]
        rows.append((at, *factor.keys(), number, cameras.setdefault(id(K), (len(cameras), K))[0]))
        uv_px.append(factor.measured())
    place, pose, point, noise, camera = np.array(rows, dtype=np.int64).reshape(-1, 5).T
    observations = ProjectionFactors(place, pose, point, noise, camera, np.array(uv_px).reshape(-1, 2))
    noises = [read_noise(model) for _, model in models.values()]
    read = [(K.fx(), K.fy(), K.skew(), K.px(), K.py()) for _, K in cameras.values()]
    return observations, noises, read, others


def usual(
    observations: ProjectionFactors, noises: list[Noise | None], cameras: list[Calibration]
) -> BoolArray:
    """(N,) those of one calibration without skew, and of no loss or the most frequent one."""
    loss = np.array(["unknown" if noise is None else noise.loss for noise in noises])[observations.noise]
    known = [name for name in loss.tolist() if name not in ("none", "unknown")]
    good = (loss == "none") | (loss == _most_frequent(known))
    square = np.array([K[2] == 0.0 for K in cameras])[observations.camera]
    one = _most_frequent([cameras[i] for i in observations.camera[good & square].tolist()])
    return np.asarray(good & np.array([one == K for K in cameras])[observations.camera])


def _most_frequent(things: list[Any]) -> Any:
    return Counter(things).most_common(1)[0][0] if things else None


def with_more(
    graph: gtsam.NonlinearFactorGraph, observations: ProjectionFactors, usual: BoolArray, others: list[int]
) -> BoolArray:
    """(N,) whether the landmark has other factors than readable projections, or two in one pose."""
    touched = {key for place in others for key in list(graph.at(place).keys())}
    pairs = np.stack([observations.pose, observations.point])
    _, pair, times = np.unique(pairs[:, usual], axis=1, return_inverse=True, return_counts=True)
    twice = observations.point[usual][times[pair.ravel()] > 1]
    more = np.concatenate([observations.point[~usual], twice, np.array(sorted(touched), dtype=np.int64)])
    return np.isin(observations.point, more)
