"""The GPS clock against the video's, by the path that the video alone shows."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError
from vgps.gps.camera_roll import camera_turned_deg
from vgps.gps.clock_rate import ShownClock, parts_agree, search_clock_rate
from vgps.gps.clock_search import (
    ClockCheck,
    levelled,
    mirrored_share,
    search_time_offset,
    shows_no_time_offset,
    unexplained_share,
)
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.gps.time_offset import estimate_time_offset, with_agreed_clock
from vgps.gps.video_speed import EXPLAINED_SHARE
from vgps.model import FloatArray, Recording
from vgps.pipeline.camera_refinement import moved_far, with_settled_camera
from vgps.pipeline.compared_path import in_the_world, outside_share, seen_part, through_few
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.rough_solution import video_alone
from vgps.pipeline.solved_maps import merged_maps
from vgps.runtime.progress import Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.smoothing.merging.torn_path import untorn_path
from vgps.solution import GpsClock, Trajectory

_TORN_SHARE = 0.5  # of the fixes, outside regions that hold 95 %
_FAR = (
    "the fixes have the shape of the path if they are {0:.1f} s older than their time stamps, more than was "
    "searched: set sensors: {{time_offset_s: {0:.1f}}}"
)
_MIRRORED = (
    "the fixes turn left where the video turns right: its picture is mirrored, or its path hangs upside "
    "down. The poses are wrong, whatever their standard deviations: give the picture as the camera saw it"
)
_FOUND = (
    "the GPS positions are about {0:.2f} s older than their time stamps, as the shape of the path shows; the "
    "run began again with that: give sensors: {{time_offset_s: {0:.2f}}} to save the time"
)
_RATE = (
    "the clocks of GPS and video differ by {0:.1%}, as the shape of the path shows: {1:.2f} frames a second "
    "are about {2:.2f}. The run goes on with that: give the frames their right times, or sensors: "
    "{{time_offset_s: {3:.2f}, clock_rate: {4:.4f}}}"
)


def with_gps_clock(front_end: FrontEnd, config: Config) -> FrontEnd:
    """Return the front end with the time offset between GPS and video as the video alone shows it.

    Windows of stage C, and a solution of stage D, bend the path to fixes whose clock is wrong until hardly
    anything of it is left to see; so the fixes are compared with a rough solution without them. An offset
    beyond reach is for another run, see :func:`with_right_clock`.

    Args:
        front_end: Its sensors have the time offset that stage C saw.
        config: Settings.
    """
    if front_end.clock is not None or config.gps.model == "none":
        return front_end
    timer = StageTimer(dict(front_end.seconds))
    with one_blas_thread(), timer.measure("batch"):
        compared = _compared(front_end, config)
    return replace(compared, clock=compared.clock or ClockCheck(None), seconds=timer.by_stage)


def with_right_clock(front_end: FrontEnd, config: Config, progress: Progress) -> tuple[FrontEnd, Config]:
    """Return the front end with the GPS clock compared; if it is off, of stages A to C run again.

    A guessed lens that is wrong bends a path, too, so the video alone is asked for it first. A path that was
    torn to the fixes may show nothing. Then one that was built without them shows the offset.
    """
    compared = _compared_by_the_right_camera(front_end, config, progress)
    clock, recording = compared.clock, compared.recording
    try:
        if clock is not None and clock.torn and not clock.turned_deg:
            progress.stage("again without the fixes, which the path contradicts")
            alone = run_front_end(recording, config.with_gps("none"), progress)
            clock = clock_by_shape(alone, compared.fixes, config)
            if clock.turned_deg:
                return replace(compared, clock=clock), config
            clock = clock._replace(torn=True)
        if (other := _other(clock, compared.sensors, config)) is None:
            return compared, config
        progress.stage("again with the GPS clock that the video shows")
        recording, changed = _with_clock(recording, config, other)
        again = with_gps_clock(run_front_end(recording, changed, progress), changed)
    except (GeometryError, GpsLogError):  # the first run had a path
        return compared, config
    return (again, changed) if _confirmed(again, config, changed) else (compared, config)


def _compared_by_the_right_camera(front_end: FrontEnd, config: Config, progress: Progress) -> FrontEnd:
    """Return the front end with the GPS clock compared, with another camera if that was wrong instead.

    It was if the path that it gives explains the fixes better, each at the time offset that suits it best.
    """
    compared = with_gps_clock(front_end, config)
    recording, clock = compared.recording, compared.clock
    if clock is None or not (clock.torn or clock.other or _far(clock, config) is not None):
        return compared
    if not recording.guesses or config.intrinsics.refine == "no" or front_end.others:
        return compared
    try:
        seen = with_settled_camera(front_end, config, progress, torn=clock.torn)
        if not moved_far(seen.camera, recording.camera, config.camera_calibration.restart_share):
            return compared
        progress.stage("again with the camera that the video alone shows")
        again = with_gps_clock(run_front_end(seen, config, progress), config)
    except (GeometryError, GpsLogError, np.linalg.LinAlgError):  # the first run had a path
        return compared
    return min(compared, again, key=lambda one: unexplained(one, config))


def unexplained(front_end: FrontEnd, config: Config) -> float:
    """Return the share of the fixes' motion that the video alone does not explain, whatever their clock."""
    clock, sensors = front_end.clock, front_end.sensors
    if clock is None or clock.video is None:
        return np.inf
    steady = front_end.fixes.without_clock_rate(sensors)
    return unexplained_share(clock.video, steady, sensors.camera_p_antenna, config.sensors)


def clock_by_shape(alone: FrontEnd, fixes: Fixes, config: Config) -> ClockCheck:
    """Return what a path that has never met the fixes shows of their clock.

    Args:
        alone: Stages A to C without fixes.
        fixes: At the times of their time stamps.
        config: Settings.
    """
    # with other settings the fixes would bend the path where maps are merged
    context = alone.context(config.with_gps("none"))
    scene = merged_maps(alone, context).scene
    path = untorn_path(scene.trajectory, scene, fixes, config.tracking.min_inliers)
    path = levelled(path, config.start)
    antenna, settings = alone.sensors.camera_p_antenna, config.sensors
    mirrored = mirrored_share(path, fixes, antenna, settings) is not None
    turned_deg = camera_turned_deg(path, config.start, upside_down=mirrored)
    shown_s = search_time_offset(path, fixes, antenna, settings)
    return ClockCheck(shown_s, turned_deg=turned_deg, mirrored=mirrored)


def _far(clock: ClockCheck, config: Config) -> float | None:
    """Return the time offset that the video shows if it is beyond the search about the configured one."""
    if clock.shown_s is None:
        return None
    sensors = config.sensors
    beyond = abs(clock.shown_s - sensors.time_offset_s) > sensors.time_offset_reach_s
    return clock.shown_s if beyond else None


def _other(clock: ClockCheck | None, sensors: Sensors, config: Config) -> GpsClock | None:
    """Return the clock that the video shows beyond doubt, if stages A to C need it.

    They do if stage D has no way to it: it is far off, or the fixes have torn the path, or displacements say
    it as well but are not certain. By the shape alone clocks of short videos may seem to differ by a tenth of
    a second.

    Args:
        clock: What the shape of a path shows.
        sensors: With what displacements along a path say, unless it is torn.
        config: The configured clock.
    """
    if clock is None or clock.other is not None:
        return None if clock is None else clock.other
    other_s, shown_s = _far(clock, config), clock.shown_s
    if shown_s is not None and _differs(shown_s, config) and (clock.torn or _is_doubted(sensors, config)):
        other_s = shown_s
    return None if other_s is None else GpsClock(other_s, config.sensors.clock_rate)


def _is_doubted(sensors: Sensors, config: Config) -> bool:
    """Return whether displacements say that the clocks differ, but are not certain."""
    is_certain = sensors.prior_time_offset.sigma_s > 0.0 and sensors.agreed is None
    said = None if is_certain else sensors.by_displacements
    return said is not None and _differs(said.time_offset_s, config)


def _differs(time_offset_s: float, config: Config) -> bool:
    """Return whether clocks that agree to some hundredths of a second do not have a time offset."""
    sensors = config.sensors
    trusted_s = sensors.significance_sigmas * sensors.trusted_time_offset_s
    return abs(time_offset_s - sensors.time_offset_s) > trusted_s


def _with_clock(recording: Recording, config: Config, clock: GpsClock) -> tuple[Recording, Config]:
    """Return recording and settings of a run that begins with a clock and improves it; a note states it."""
    note = _FOUND.format(clock.time_offset_s)
    if clock.rate != config.sensors.clock_rate:
        note = _rate_note(clock, recording.video.times_s)
    changes = {"time_offset_s": clock.time_offset_s, "clock_rate": clock.rate, "estimate_time_offset": "yes"}
    sensors = config.sensors.model_copy(update=changes)
    noted = replace(recording, notes=(*recording.notes, note))
    return noted, config.model_copy(update={"sensors": sensors})


def _confirmed(again: FrontEnd, before: Config, now: Config) -> bool:
    """Return whether the path of a run that began with another clock shows it as well."""
    if again.clock is None:
        return False
    changed = now.sensors.clock_rate - before.sensors.clock_rate
    if changed:
        shown, sensors = again.sensors.clock_rate - before.sensors.clock_rate, again.sensors
        return abs(shown - changed) < 0.5 * abs(changed) and parts_agree(shown, sensors.clock_rate_sigma)
    known = again.clock.shown_s is not None and _far(again.clock, now) is None
    return known and _differs(again.sensors.time_offset_s, before)


def _rate_note(clock: GpsClock, times_s: FloatArray) -> str:
    """Return what is said of a clock of another rate."""
    rate_hz = (len(times_s) - 1) / float(np.ptp(times_s))
    return _RATE.format(abs(clock.rate), rate_hz, rate_hz * (1.0 - clock.rate), *clock)


def _compared(front_end: FrontEnd, config: Config) -> FrontEnd:
    merged = merged_maps(front_end, front_end.context(config))
    sensors, fixes = front_end.sensors, front_end.fixes
    used = fixes.used & merged.georeferenced
    if config.sensors.estimate_time_offset == "no" or not used.any():
        return front_end
    path, settings = seen_part(merged.scene), config.sensors
    try:
        video = through_few(video_alone(front_end, merged, config), path)
        video = untorn_path(video, merged.scene, fixes, config.tracking.min_inliers)
    except GeometryError:  # stage D says why
        return front_end
    steady = fixes.without_clock_rate(sensors)
    shown_s = search_time_offset(video, steady, sensors.camera_p_antenna, settings)
    torn = shown_s is None and outside_share(path, fixes, sensors) > _TORN_SHARE
    clock = ClockCheck(shown_s, torn, video=video)
    front_end = replace(front_end, clock=clock)
    if (far_s := _far(clock, config)) is not None:
        return replace(front_end, warnings=(*front_end.warnings, _FAR.format(far_s)))
    share = mirrored_share(video, steady, sensors.camera_p_antenna, settings)
    mirrored = share is not None
    turned_deg = camera_turned_deg(video, config.start, upside_down=mirrored)
    if turned_deg or mirrored:
        told = (_MIRRORED,) if share is not None and share < EXPLAINED_SHARE else ()
        clock = ClockCheck(shown_s, torn, video=video, turned_deg=turned_deg, mirrored=mirrored)
        front_end = replace(front_end, clock=clock, warnings=(*told, *front_end.warnings))
    elif (shown := _of_another_rate(video, fixes, sensors, config)) is not None:
        other = shown.clock if shown.is_significant or settings.clock_rate else None
        front_end = replace(front_end, clock=ClockCheck(shown_s, other=other, video=video))
        if settings.rate_is_given or parts_agree(shown.clock.rate, shown.rate_sigma):
            return _with_rate(front_end, shown, config)
    if abs(sensors.time_offset_s - settings.time_offset_s) <= settings.time_offset_reach_s:
        path = video  # else what stage C's odometry showed has torn the path too much for that
    corrected = fixes.on_video_clock(sensors)
    path = in_the_world(path, corrected, sensors.camera_p_antenna, config)
    found, notes = estimate_time_offset(sensors, path, steady, config)
    if shows_no_time_offset(video, steady, sensors.camera_p_antenna, settings):
        found = replace(found, by_displacements=TimeOffset.from_config(settings))
    else:
        found = with_agreed_clock(found, path, steady, settings)
    return replace(front_end, sensors=found, warnings=(*front_end.warnings, *notes))


def _with_rate(front_end: FrontEnd, shown: ShownClock, config: Config) -> FrontEnd:
    """Return the front end with a clock of another rate, of which a run that began with one has a note."""
    settings, video = config.sensors, front_end.recording.video
    told = () if settings.rate_is_given else (_rate_note(shown.clock, video.times_s),)
    sigma_s = float(np.hypot(shown.time_offset_sigma_s, settings.trusted_time_offset_s))
    found = front_end.sensors.with_clock(shown.clock, sigma_s, shown.rate_sigma)
    return replace(front_end, sensors=found, warnings=(*front_end.warnings, *told))


def _of_another_rate(video: Trajectory, fixes: Fixes, sensors: Sensors, config: Config) -> ShownClock | None:
    """Return the clock that a path without fixes shows, if its rate is not that of the sensors.

    Where a run has begun with a rate that the video showed before, it is estimated again.
    """
    path = in_the_world(video, fixes.on_video_clock(sensors), sensors.camera_p_antenna, config)
    steady, settings = fixes.without_clock_rate(sensors), config.sensors
    again = settings.rate_is_given and settings.estimate_time_offset == "yes"
    found = search_clock_rate(path, steady, sensors.camera_p_antenna, settings, anyway=again)
    if found is None:
        return None
    rate = 1.0 - (1.0 - sensors.clock_rate) * (1.0 - found.clock.rate)
    return found._replace(clock=GpsClock(found.clock.time_offset_s, rate))
