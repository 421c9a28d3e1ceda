"""Whether two views show a motion at all, and which of two motions, by their features as witnesses.

While a camera turns on the spot, wrong matches pass for parallax, and the essential matrix shows any motion.
"""

from collections.abc import Callable

import numpy as np

from vgps.model import FloatArray

_SPLITS = 9
_QUANTILE = 1 / 3  # of the splits: halves of a plane's features may take either of its two motions
_CLEAR = 3.0  # standard deviations

Directions = Callable[[FloatArray, FloatArray], FloatArray]


def shows_motion(
    first_px: FloatArray, last_px: FloatArray, directions: Directions, max_chance: float
) -> bool:
    """Return whether features show a motion more clearly than chance lets features that show none.

    Disjoint halves show directions an angle ``a`` or less apart with a probability of ``(1 - cos a) / 2`` by
    chance, as often as there are pairs of them. Of several random splits a quantile over its order bounds
    that of all: Eq. (2.2), Meinshausen, Meier and Buehlmann, P-values for high-dimensional regression, 2009.

    Args:
        first_px, last_px: (N, 2) the features in two views.
        directions: The unit vectors (M, 3) that some of them may show.
        max_chance: Probability of taking features for witnesses of a motion that they do not show; 1 asks
            none.
    """
    if max_chance >= 1.0:
        return True
    rng, clear, needed = np.random.default_rng(0), 0, int(_QUANTILE * _SPLITS)
    for left in reversed(range(_SPLITS)):
        order = rng.permutation(len(first_px))
        halves = (order[: len(order) // 2], order[len(order) // 2 :])
        one, other = (directions(first_px[half], last_px[half]) for half in halves)
        pairs = 0.5 * (1.0 - one @ other.T)
        clear += int(max(pairs.size, 1) * np.min(pairs, initial=1.0) <= _QUANTILE * max_chance)
        if clear == needed or clear + left < needed:  # whatever the others show
            break
    return bool(clear >= needed)


def fits_better(misfit: FloatArray, other: FloatArray) -> bool:
    """Return whether features fit one model better than another beyond their scatter (Vuong's test, 1989).

    Args:
        misfit, other: (N,) mean squared errors of each feature by either model.
    """
    gain = other - misfit
    return bool(gain.mean() * np.sqrt(len(gain)) > _CLEAR * gain.std())
