"""How long does an iteration of the Schur solver take, and one of GTSAM's optimiser, on a synthetic drive?

Medians of the difference between a long and a short run, so that what is done once per problem is left out.
With several laps the drive goes round a block, and most landmarks are observed again in every lap.
"""

import statistics
from typing import get_args

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from scripts.common.command import ScriptParser
from scripts.common.stopwatch import stopwatch
from vgps.model import FloatArray, IntArray
from vgps.solver.bundle_adjustment import Solver, SolverSettings, solve
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem

K = (500.0, 510.0, 320.0, 240.0)
HELP = {"track": "mean length of a track, frames", "runs": "runs whose median is taken"}


def winding_drive(frames: int) -> FloatArray:
    """Return (F, 4, 4) poses on a winding path, half a metre apart."""
    yaw = 0.3 * np.sin(np.arange(frames) / 40.0)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = [gtsam.Rot3.Ry(angle).matrix() for angle in yaw]
    poses[:, :3, 3] = np.cumsum(0.5 * np.stack([np.sin(yaw), np.zeros(frames), np.cos(yaw)], axis=1), axis=0)
    return poses


def round_the_block(frames: int, laps: int) -> FloatArray:
    """Return (F, 4, 4) poses on a circle, half a metre apart, each lap a little farther out than the last."""
    lap = frames / laps
    angle = 2 * np.pi * np.arange(frames) / lap
    radius = 0.5 * lap / (2 * np.pi) + 0.3 * (np.arange(frames) // lap)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = [gtsam.Rot3.Ry(-a).matrix() for a in angle]
    poses[:, :3, 3] = np.stack([radius * np.cos(angle), np.zeros(frames), radius * np.sin(angle)], axis=1)
    return poses


def observed_again(
    poses: FloatArray, points: FloatArray, frame: IntArray, landmark: IntArray, lap: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return frame, landmark and pixels of the same observations a lap later, of seven landmarks in ten."""
    again = (landmark % 10 < 7) & (frame + lap < len(poses))
    frame, landmark = frame[again] + lap, landmark[again]
    return project(poses, points, frame, landmark)


def project(
    poses: FloatArray, points: FloatArray, frame: IntArray, landmark: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return frame, landmark and pixels (N, 2) of the points that lie more than a metre ahead."""
    p = np.einsum("nji,nj->ni", poses[frame, :3, :3], points[landmark] - poses[frame, :3, 3])
    ahead = p[:, 2] > 1.0
    frame, landmark, p = frame[ahead], landmark[ahead], p[ahead]
    return (
        frame,
        landmark,
        np.stack([K[0] * p[:, 0] / p[:, 2] + K[2], K[1] * p[:, 1] / p[:, 2] + K[3]], axis=1),
    )


def observations(
    poses: FloatArray, landmarks: int, track: int, rng: np.random.Generator
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Return points, and frame, landmark and noisy pixels of tracks of ``track`` frames on average."""
    first = np.clip(rng.integers(-track, len(poses) - 2, landmarks), 0, None)
    length = np.minimum(2 + rng.geometric(1.0 / track, landmarks), len(poses) - first)
    depth = 0.5 * length + rng.uniform(3.0, 20.0, landmarks)
    ray = np.stack(
        [rng.uniform(-0.6, 0.6, landmarks), rng.uniform(-0.4, 0.4, landmarks), np.ones(landmarks)], 1
    )
    points = np.einsum("lij,lj->li", poses[first, :3, :3], ray * depth[:, None]) + poses[first, :3, 3]
    landmark = np.repeat(np.arange(landmarks), length)
    frame = first[landmark] + np.arange(len(landmark)) - np.repeat(np.cumsum(length) - length, length)
    frame, landmark, uv = project(poses, points, frame, landmark)
    return points, frame, landmark, uv + rng.normal(0.0, 0.5, uv.shape)


def pose_factors(poses: FloatArray, rng: np.random.Generator) -> gtsam.NonlinearFactorGraph:
    """Return a fix every tenth frame, and a loose motion from each frame to the next."""
    graph = gtsam.NonlinearFactorGraph()
    fix = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    for i in range(0, len(poses), 10):
        graph.add(gtsam.GPSFactor(X(i), poses[i, :3, 3] + rng.normal(0.0, 0.1, 3), fix))
    loose = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.5, 0.5, 0.5, 5.0, 5.0, 5.0]))
    for i in range(len(poses) - 1):
        motion = gtsam.Pose3(poses[i]).between(gtsam.Pose3(poses[i + 1]))
        graph.add(gtsam.BetweenFactorPose3(X(i), X(i + 1), motion, loose))
    return graph


def make_problem(frames: int, landmarks: int, track: int, laps: int) -> BundleProblem:
    """Return the drive; its start is off by 0.1 deg and 0.1 m, its points by 0.2 m."""
    rng = np.random.default_rng(0)
    poses = winding_drive(frames) if laps == 1 else round_the_block(frames, laps)
    lap = -(-frames // laps)
    points, frame, landmark, uv = observations(poses[:lap], landmarks, track, rng)
    rows = [(frame, landmark, uv)]
    for number in range(1, laps):
        rows.append(observed_again(poses, points, frame, landmark, number * lap))
    frame, landmark, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    shift = rng.normal(size=(frames, 6)) * [0.002, 0.002, 0.002, 0.1, 0.1, 0.1]
    start = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in zip(poses, shift, strict=True)])
    sigma = rng.choice([1.5, 3.0, 6.0], landmarks)[landmark]
    near = points + rng.normal(0.0, 0.2, points.shape)
    return BundleProblem(
        K=K,
        world_T_camera=start,
        world_p_landmark=near,
        frame=frame,
        landmark=landmark,
        uv_px=uv,
        sigma_px=sigma,
        pose_graph=pose_factors(poses, rng),
    )


def per_iteration(problem: BundleProblem, solver: Solver, iterations: int, runs: int) -> float:
    """Return the median seconds of one iteration, without what is done once per problem."""
    never = {"relative_tolerance": 0.0, "absolute_tolerance": 0.0}
    seconds = []
    for _ in range(runs):
        short = solve(problem, SolverSettings(max_iterations=1, **never), solver)
        long = solve(problem, SolverSettings(max_iterations=1 + iterations, **never), solver)
        seconds.append((long.seconds - short.seconds) / (long.report.iterations - short.report.iterations))
    return statistics.median(seconds)


def main() -> None:
    """Print what each solver takes."""
    parser = ScriptParser("benchmarks.bundle", __doc__)
    defaults = {"frames": 1110, "landmarks": 12000, "track": 12, "iterations": 4, "runs": 3, "laps": 1}
    for name, value in defaults.items():
        parser.add_argument(f"--{name}", type=int, default=value, help=HELP.get(name, "number"))
    given = parser.parse_args()
    with parser.refusals():
        results = parser.results(given)
    problem = make_problem(given.frames, given.landmarks, given.track, given.laps)
    structure = analyse_sparsity(problem)
    print(f"{given.frames} frames, {len(problem.frame)} observations, {given.landmarks} landmarks")
    stored = "in blocks" if structure.blocks else f"half bandwidth {structure.half_bandwidth}"
    print(f"{stored}, {structure.flops / 1e9:.1f} Gflop per factorisation")
    seconds = {name: per_iteration(problem, name, given.iterations, given.runs) for name in get_args(Solver)}
    ratio = seconds["gtsam"] / seconds["schur"]
    print(f"schur {seconds['schur']:.3f} s, gtsam {seconds['gtsam']:.3f} s per iteration: ratio {ratio:.1f}")
    best = solve(problem)
    with stopwatch() as elapsed:
        marginal_covariances(best.problem)
    print(
        f"solved in {best.seconds:.2f} s, {best.report.iterations} iterations; "
        f"covariances {elapsed.wall_s:.2f} s"
    )
    results.add(
        frames=given.frames,
        observations=len(problem.frame),
        landmarks=given.landmarks,
        laps=given.laps,
        schur_iteration_s=seconds["schur"],
        gtsam_iteration_s=seconds["gtsam"],
        solved_s=best.seconds,
        iterations=best.report.iterations,
        covariances_s=elapsed.wall_s,
    )


if __name__ == "__main__":
    main()
