"""The first step of a calibration: guesses of the lens are fitted to pairs of views, and compared.

A guess is a lens model with a prior. Each is fitted from a ladder of focal lengths, as steps from a wrong one
end in local minima. A guess gives way to a later one of larger marginal likelihood, by Laplace,

    log p(pairs) = -cost - 1/2 log |information . diag(sigma_prior^2)| + const.

Where the fits are different lenses it must be significantly larger, by the scatter of the difference between
the pairs (Vuong 1989, with pairs as clusters).
"""

from dataclasses import dataclass
from itertools import islice

import numpy as np

from vgps.camera_calibration.lens import parameters_of, with_parameters
from vgps.camera_calibration.two_view import (
    LensFit,
    LensPrior,
    fit_lens,
    noise_of,
    pair_losses,
    start_of_pairs,
)
from vgps.config import CameraCalibrationConfig, Config
from vgps.model import Camera, CameraGuess, FloatArray, Recording
from vgps.runtime.progress import Progress
from vgps.runtime.threads import one_blas_thread
from vgps.tracking.view_pairs import ViewPairs, view_pairs

_LADDER = 2.0 ** np.arange(-0.5, 2.5, 0.5)  # focal lengths over half the diagonal: fisheyes of 162 to 29 deg
_REACH_SIGMAS = 3.0  # of a guess's focal length: steps of the ladder beyond are not tried
_TRIED = 2  # of the starts, those with the lowest cost
_LOG_ODDS = float(np.log(20.0))  # that what a file states is right
_PULLED_SIGMAS = 2.0  # of its focal length: a fit that is further from a guess shows that it is wrong
_PAIR_UNKNOWNS = 5  # of the geometry of a pair, each of which follows the errors of features by half a unit
_SIGNIFICANT_SIGMAS = 2.0  # of the scatter between pairs
_COARSE_FEATURES = 60  # of each pair, from which the starts are compared
_COARSE_STEPS = 8  # of a fit to them, enough to be near its minimum


@dataclass(frozen=True)
class FoundLens:
    """A camera found from pairs of views, and the guess that it comes from."""

    camera: Camera
    guess: CameraGuess


def calibrate_from_pairs(recording: Recording, config: Config, progress: Progress) -> FoundLens:
    """Return the guess of a recording's camera that fits its pairs of views best, fitted to them.

    With too few pairs, as of a camera that hardly moves, the first guess stays as it is.
    """
    settings, video = config.camera_calibration, recording.video
    count = min(len(video.times_s), settings.max_frames)
    frames = video.frames()
    with one_blas_thread():
        pairs = view_pairs(
            progress.track(islice(frames, count), count),
            (video.width, video.height),
            config.tracking,
            settings,
            np.random.default_rng(config.seed),
        )
        if pairs.count < settings.min_pairs:
            return FoundLens(recording.guesses[0].camera, recording.guesses[0])
        return fit_guesses(pairs, recording.guesses, settings)


def fit_guesses(
    pairs: ViewPairs, guesses: tuple[CameraGuess, ...], settings: CameraCalibrationConfig
) -> FoundLens:
    """Return the guess under which the pairs are likeliest, fitted to them."""
    few = pairs.thinned(_COARSE_FEATURES)
    coarse = [_fitted(few, guess, settings.noise_px) for guess in guesses]
    noise_px = min(settings.noise_px, *(noise_of(few, fit) for fit in coarse))
    fits = [
        fit_lens(pairs, prior_of(guess), fit.parameters, noise_px, settings.iterations)
        for guess, fit in zip(guesses, coarse, strict=True)
    ]
    best = 0
    for k in range(1, len(guesses)):
        if _contradicts(pairs, (guesses[best], fits[best]), (guesses[k], fits[k]), noise_px):
            best = k
    return FoundLens(with_parameters(guesses[best].camera, fits[best].parameters), guesses[best])


def prior_of(guess: CameraGuess) -> LensPrior:
    """Return a guess as the prior of a fit."""
    return LensPrior(guess.camera.model, parameters_of(guess.camera), guess.sigmas)


def _fitted(pairs: ViewPairs, guess: CameraGuess, noise_px: float) -> LensFit:
    """Return the best fit from a few starts of the focal length."""
    prior = prior_of(guess)
    starts = [prior.mean, *_ladder(guess)]
    cost = [start_of_pairs(pairs, prior, start, noise_px).cost for start in starts]
    tried = np.argsort(cost)[:_TRIED].tolist()
    fits = [fit_lens(pairs, prior, starts[k], noise_px, _COARSE_STEPS) for k in tried]
    return min(fits, key=lambda fit: fit.cost)


def _ladder(guess: CameraGuess) -> list[FloatArray]:
    """Return the parameters of a guess with the focal lengths of the ladder that it allows for."""
    camera, mean = guess.camera, parameters_of(guess.camera)
    off = np.log(_LADDER * np.hypot(camera.width, camera.height) / 2) - mean[0]
    near = off[np.abs(off) < _REACH_SIGMAS * guess.focal_sigma]
    return [mean + np.array([step, 0.0, 0.0, 0.0, 0.0]) for step in near.tolist()]


def _contradicts(
    pairs: ViewPairs, kept: tuple[CameraGuess, LensFit], other: tuple[CameraGuess, LensFit], noise_px: float
) -> bool:
    """Whether the pairs are likelier under another guess, and by more than chance would do.

    Where the motion does not show the lens, as of a camera that moves level above flat ground, a less certain
    guess lets the geometry of each pair follow the errors of its features. These are not independent within a
    pair, but nearly so between pairs. What the pairs do show pulls a fit away from a wrong statement.
    """
    if _log_likelihood(*other) - _log_likelihood(*kept) < _LOG_ODDS:
        return False
    (guess, kept_fit), (other_guess, other_fit) = kept, other
    off = kept_fit.parameters[0] - parameters_of(guess.camera)[0]
    if kept_fit.model == other_fit.model and abs(off) > _PULLED_SIGMAS * guess.focal_sigma:
        return True
    gain = pair_losses(pairs, kept_fit, noise_px) - pair_losses(pairs, other_fit, noise_px)
    chance = _SIGNIFICANT_SIGMAS * float(np.sqrt(len(gain)) * np.std(gain))
    if guess.focal_sigma < other_guess.focal_sigma:
        chance += _PAIR_UNKNOWNS / 2 * len(gain)
    return float(gain.sum()) > chance


def _log_likelihood(guess: CameraGuess, fit: LensFit) -> float:
    """Return the logarithm of the pairs' marginal likelihood under a guess, but for a constant."""
    _, shown = np.linalg.slogdet(fit.information * np.outer(guess.sigmas, guess.sigmas))
    return -fit.cost - 0.5 * float(shown)
