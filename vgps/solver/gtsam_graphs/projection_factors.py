"""The projection factors of a GTSAM graph as arrays, and which of them the engine can read."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gtsam
import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solver.gtsam_graphs.noise_models import PixelNoise, read_noise_model

Calibration = tuple[float, float, float, float, float]  # fx, fy, skew, cx, cy


@dataclass(frozen=True, kw_only=True)
class ProjectionFactors:
    """Projection factors of a graph.

    Attributes:
        factor: (N,) index of each factor in the graph.
        pose_key, point_key: (N,) keys of its pose and its landmark.
        noise: (N,) index into ``noise_models``.
        camera: (N,) index into ``calibrations``.
        uv_px: (N, 2) measured position.
        noise_models: Distinct noise models of the graph; None for those that cannot be read.
        calibrations: Distinct calibrations of the graph.
    """

    factor: IntArray
    pose_key: IntArray
    point_key: IntArray
    noise: IntArray
    camera: IntArray
    uv_px: FloatArray
    noise_models: Sequence[PixelNoise | None]
    calibrations: Sequence[Calibration]

    def __len__(self) -> int:
        return len(self.factor)

    def select(self, mask: BoolArray) -> "ProjectionFactors":
        """Return the factors for which ``mask`` (N,) is true."""
        return replace(
            self,
            factor=self.factor[mask],
            pose_key=self.pose_key[mask],
            point_key=self.point_key[mask],
            noise=self.noise[mask],
            camera=self.camera[mask],
            uv_px=self.uv_px[mask],
        )


def split_projections(graph: gtsam.NonlinearFactorGraph) -> tuple[ProjectionFactors, list[int]]:
    """Return the projection factors of a graph, and the indices of all its other factors."""
    rows, uv_px, others = [], [], []
    # the wrapper returns one object per model while it is referenced, so that each is read only once
    models: dict[int, tuple[int, gtsam.noiseModel.Base]] = {}
    cameras: dict[int, tuple[int, gtsam.Cal3_S2]] = {}
    for index in range(graph.size()):
        factor = graph.at(index)
        if factor is None:
            continue
        if type(factor) is not gtsam.GenericProjectionFactorCal3_S2 or factor.throwCheirality():
            others.append(index)
            continue
        model, K = factor.noiseModel(), factor.calibration()
        number = models.setdefault(id(model), (len(models), model))[0]
        rows.append((index, *factor.keys(), number, cameras.setdefault(id(K), (len(cameras), K))[0]))
        uv_px.append(factor.measured())
    index_, pose_key, point_key, noise, camera = np.array(rows, dtype=np.int64).reshape(-1, 5).T
    projections = ProjectionFactors(
        factor=index_,
        pose_key=pose_key,
        point_key=point_key,
        noise=noise,
        camera=camera,
        uv_px=np.array(uv_px).reshape(-1, 2),
        noise_models=[read_noise_model(model) for _, model in models.values()],
        calibrations=[(K.fx(), K.fy(), K.skew(), K.px(), K.py()) for _, K in cameras.values()],
    )
    return projections, others


def readable_projections(
    graph: gtsam.NonlinearFactorGraph, projections: ProjectionFactors, others: Sequence[int]
) -> BoolArray:
    """Return which projections (N,) the engine can take as arrays.

    They share one calibration without skew and, apart from those without a loss, one loss. Their landmarks
    have no other factors, and are observed at most once from each pose.

    Args:
        graph: The graph.
        projections: Its projection factors.
        others: Indices of its other factors.
    """
    common = _with_common_models(projections)
    return common & ~_has_other_factors(graph, projections, common, others)


def _with_common_models(projections: ProjectionFactors) -> BoolArray:
    """Return which projections have the most frequent calibration, and no loss or the most frequent one."""
    names = ["unknown" if noise is None else noise.loss for noise in projections.noise_models]
    loss = np.array(names)[projections.noise]
    robust = [name for name in loss.tolist() if name not in ("none", "unknown")]
    good = (loss == "none") | (loss == _most_frequent(robust))
    no_skew = np.array([K[2] == 0.0 for K in projections.calibrations])[projections.camera]
    usual = _most_frequent([projections.calibrations[i] for i in projections.camera[good & no_skew].tolist()])
    return np.asarray(good & np.array([usual == K for K in projections.calibrations])[projections.camera])


def _most_frequent(items: list[Any]) -> Any:
    return Counter(items).most_common(1)[0][0] if items else None


def _has_other_factors(
    graph: gtsam.NonlinearFactorGraph,
    projections: ProjectionFactors,
    common: BoolArray,
    others: Sequence[int],
) -> BoolArray:
    """Return whose landmarks have factors beyond the common projections, or two of these in one pose."""
    keys = {key for index in others for key in list(graph.at(index).keys())}
    pairs = np.stack([projections.pose_key, projections.point_key])
    _, pair, count = np.unique(pairs[:, common], axis=1, return_inverse=True, return_counts=True)
    twice = projections.point_key[common][count[pair.ravel()] > 1]
    tied = np.concatenate([projections.point_key[~common], twice, np.array(sorted(keys), dtype=np.int64)])
    return np.isin(projections.point_key, tied)
