"""What a run says of a GPS clock, a lever arm and an upright camera that nobody measured, and of a lorry."""

from dataclasses import replace

import numpy as np

from vgps.config import Config, SensorsConfig, StartConfig
from vgps.model import FloatArray
from vgps.pipeline.front_end import FrontEnd
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Solution

_FAR_SIGMAS = 3.0  # of the roll that is assumed
_UNKNOWN_SHARE = 0.25  # of the prior's sigma; 0.7 where nothing is seen, as clocks agree half of the time
_LEAST_MOVED_M = 0.1  # a camera that hardly moves needs no clock
_NOTABLE_SIGMAS = 2.0  # standard deviations of what clocks that agree differ by
_LARGE_SHARE = 0.1  # of the picture; what covers less can hardly outvote the scene


def upright_notes(world_T_camera: FloatArray, config: StartConfig) -> tuple[str, ...]:
    """Return a warning if the camera hangs upside down, against the roll that was assumed.

    One that flies and looks straight up at the sky is an upside-down one that looks straight down.

    Args:
        world_T_camera: (F, 4, 4) poses, z up; a camera that looks straight down has a level head.
        config: The roll, and its standard deviation.
    """
    down_and_forward = (world_T_camera[:, :3, :3] @ config.upright)[:, 2, 1:]
    elevation = np.arcsin(np.clip(np.median(down_and_forward, axis=0), -1.0, 1.0))
    below_deg, view_deg = np.degrees(elevation).tolist()
    far_deg = _FAR_SIGMAS * config.tilt_sigmas_deg[0]
    if below_deg >= far_deg:
        found = f"the camera hangs upside down: its head points {below_deg:.0f} degrees below the horizon"
    elif config.flies and view_deg > 90.0 - far_deg:
        found = f"the camera looks up at the sky, {view_deg:.0f} degrees above the horizon"
    else:
        return ()
    return (
        f"{found} in the median frame. Unless it was mounted like that, all rotations are wrong, whatever "
        "their standard deviations: a video that begins with a turn on the spot does that; leave that part "
        "out",
    )


def antenna_notes(
    front_end: FrontEnd, merged: MergedMaps, batch: BatchResult, config: Config
) -> tuple[str, ...]:
    """Return a warning if the lever arm is not known: what the motion says of it."""
    sigma_m, prior_m = batch.antenna_sigma_m, batch.sensors.antenna_sigma_m
    if front_end.recording.rig.antenna_known or not merged.georeferenced or not np.isfinite(sigma_m).all():
        return ()
    shown = [
        axis
        for axis, sigma in zip(("right", "down", "forward"), sigma_m.tolist(), strict=True)
        if sigma < config.sensors.time_offset.shown_share * prior_m
    ]
    place, sigmas = (", ".join(f"{x:.2f}" for x in row) for row in (batch.sensors.camera_p_antenna, sigma_m))
    says = f"shows it along {' and '.join(shown)} only" if shown else "does not show it"
    says = "shows it" if len(shown) == 3 else says
    return (
        f"the antenna's place in the camera is not given: it was taken as zero, uncertain by {prior_m:g} m, "
        f"and the motion {says} (estimate {place} m, standard deviations {sigmas} m): measure it and give "
        "camera_p_antenna in rig.yaml",
    )


def clock_notes(front_end: FrontEnd, batch: BatchResult, config: SensorsConfig) -> tuple[str, ...]:
    """Return a warning if stage D shifted fixes by a time offset that was not certain before, or saw none."""
    before, after = front_end.sensors, batch.sensors
    speed_m_s = batch.trajectory.length_m / max(float(np.ptp(batch.trajectory.t_s)), 1e-9)
    held_m = after.held_sigma_s * speed_m_s
    if after.held_sigma_s > _UNKNOWN_SHARE * config.time_offset_prior_s and held_m >= _LEAST_MOVED_M:
        return (
            "the motion does not determine the time offset between video and GPS: it was held at "
            f"{after.time_offset_s:g} s, uncertain by {after.held_sigma_s:.2f} s or {held_m:.1f} m along the "
            "path, which the standard deviations cover. Set sensors: {estimate_time_offset: 'no'} if the "
            "clocks agree, or record turns and braking",
        )
    was_certain = before.prior_time_offset.sigma_s and before.probability == 1.0 and before.agreed is None
    if not after.prior_time_offset.sigma_s or was_certain:
        return ()
    sigma_s = float(batch.time_offset_sigma_s[0])
    if (
        before.agreed is not None
        and abs(after.time_offset_s - config.time_offset_s) < _NOTABLE_SIGMAS * sigma_s
    ):
        return ()
    late = f"{after.time_offset_s:.3f} s (standard deviation {sigma_s:.3f} s)"
    why = (
        "as all poses together show"
        if after.shown_by_poses
        else f"with a probability of {after.probability:.0%}"
    )
    text = f"the GPS positions are {late} older than their time stamps, {why}"
    return (f"{text}; the fixes were shifted accordingly",)


def with_moving_note(solution: Solution) -> Solution:
    """Return a solution with a warning if something large moved on its own in the picture."""
    share = solution.moving_share
    large = np.flatnonzero(share > _LARGE_SHARE)
    if not len(large):
        return solution
    first_s, last_s = solution.t_s[large[[0, -1]]]
    note = (
        f"something that moves on its own, such as a lorry, covers up to {share.max():.0%} of the picture in "
        f"{len(large)} frames from {first_s:.1f} to {last_s:.1f} s, and was left out: should the video have "
        "followed it all the same, the standard deviations do not cover that. See vgps inspect; masks/ "
        "beside the video keep it out for certain"
    )
    return replace(solution, warnings=(*solution.warnings, note))
