"""What was left out of the pictures, in words."""

import numpy as np

from vgps.solution import Solution


def left_out_sentences(solution: Solution) -> list[str]:
    """Return how much of the picture was left out because it never moves, or moves on its own."""
    return [
        f"part of the picture {what} up to {100 * share.max():.1f} % of it, in {np.count_nonzero(share)} of "
        f"{len(share)} frames"
        for what, share in (
            (
                "does not move with the scene (a bonnet, text, a reflection) and was left out:",
                solution.static_share,
            ),
            ("moves on its own (a vehicle) and was left out; boxes around it cover", solution.moving_share),
        )
        if share.any()
    ]
