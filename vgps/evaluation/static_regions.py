"""What never moves in the picture, in words."""

import numpy as np

from vgps.solution import Solution


def static_sentence(solution: Solution) -> str | None:
    """Return how much of the picture was left out because it never moves; None if nothing was."""
    share = solution.static_share
    frames = int(np.count_nonzero(share))
    if not frames:
        return None
    return (
        f"part of the picture does not move with the scene (a bonnet, text, a reflection): up to "
        f"{100 * share.max():.1f} % of it was left out, in {frames} of {len(share)} frames"
    )
