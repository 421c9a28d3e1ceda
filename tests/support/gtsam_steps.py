"""The first step of the solver beside GTSAM's."""

import numpy as np
from gtsam.symbol_shorthand import L

from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.equations.schur_complement import landmark_steps, reduce_to_poses
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem


def check_first_step(problem: BundleProblem) -> None:
    """Poses and landmarks go where GTSAM's own linear system sends them, without damping."""
    graph, values = to_graph(problem)
    expected = graph.linearize(values).optimize()
    structure = analyse_sparsity(problem)
    linear = linearise(problem, all_pose_values(problem), structure)
    matrix, gradient = reduce_to_poses(linear, structure, 0.0)
    poses = -structure.cholesky(matrix).solve(gradient)
    steps = landmark_steps(linear, structure.to_frames(poses), 0.0)
    for frame, key in enumerate(problem.keys.tolist()):
        np.testing.assert_allclose(poses[6 * frame : 6 * frame + 6], expected.at(key), atol=1e-6)
    for row in np.unique(problem.landmark).tolist():
        np.testing.assert_allclose(steps[:, row], expected.at(L(row)), atol=1e-4)
