"""The first step of a calibration: a guess of the lens is fitted to pairs of views of the video."""

from dataclasses import dataclass
from itertools import islice

import numpy as np

from vgps.camera_calibration.lens import parameters_of, with_parameters
from vgps.camera_calibration.two_view import LensFit, LensPrior, fit_lens, noise_of, start_of_pairs
from vgps.config import Config
from vgps.model import Camera, CameraGuess, Recording
from vgps.runtime.progress import Progress
from vgps.runtime.threads import one_blas_thread
from vgps.tracking.view_pairs import ViewPairs, view_pairs

_STARTS = (-1.0, 0.0, 1.0)  # of the focal length, in standard deviations of the guess
_TRIED = 2  # of the starts, those with the lowest cost


@dataclass(frozen=True)
class FoundLens:
    """A camera found from pairs of views, and the guess that it comes from; ``pairs`` is their number."""

    camera: Camera
    guess: CameraGuess
    pairs: int


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
            return FoundLens(recording.guesses[0].camera, recording.guesses[0], pairs.count)
        noise_px = settings.noise_px
        fits = [_fitted(pairs, guess, noise_px, settings.iterations) for guess in recording.guesses]
        best = int(np.argmin([fit.cost for fit in fits]))
        guess, fit = recording.guesses[best], fits[best]
        finer_px = min(noise_of(pairs, fit), noise_px)
        fit = fit_lens(pairs, prior_of(guess), fit.parameters, finer_px, settings.iterations)
    return FoundLens(with_parameters(guess.camera, fit.parameters), guess, pairs.count)


def prior_of(guess: CameraGuess) -> LensPrior:
    """Return a guess as the prior of a fit."""
    return LensPrior(guess.camera.model, parameters_of(guess.camera), guess.sigmas)


def _fitted(pairs: ViewPairs, guess: CameraGuess, noise_px: float, iterations: int) -> LensFit:
    """Return the best fit from a few starts of the focal length."""
    prior = prior_of(guess)
    starts = [prior.mean + np.array([k * guess.focal_sigma, 0.0, 0.0, 0.0, 0.0]) for k in _STARTS]
    cost = [start_of_pairs(pairs, prior, start, noise_px).cost for start in starts]
    tried = np.argsort(cost)[:_TRIED].tolist()
    fits = [fit_lens(pairs, prior, starts[k], noise_px, iterations) for k in tried]
    return min(fits, key=lambda fit: fit.cost)
