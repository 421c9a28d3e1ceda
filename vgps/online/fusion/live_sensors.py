"""Clock and antenna of the receiver while the video runs, and what the user hears of them."""

from dataclasses import replace

import numpy as np

from vgps.config import Config, SensorsConfig
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.sensors import TimeOffset
from vgps.online.fusion.clock_profile import ProfiledClock
from vgps.online.fusion.clock_watch import ClockWatch
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.path_fusion import FusedPath

_FAR_SIGMAS = 3.0
_AXES = ("right", "down", "forward")


class LiveSensors:
    """Clock and antenna of the receiver, as the fits of each map show them.

    Args:
        fix_buffer: With the lever arm of the rig.
        config: What is known of them before any fit.
        antenna_known: Whether the lever arm was measured; else it is an unknown of the fits.

    Attributes:
        known_s: The time offset with which the fits of the newest map began; they find the rest of it.
        lever_arm: As known so far.
        clock_watch: Of the newest map.
        clock_away_s: By how much fits at other time offsets contradict what is believed.
    """

    def __init__(self, fix_buffer: FixBuffer, config: SensorsConfig, *, antenna_known: bool) -> None:
        self._config, self._antenna_known = config, antenna_known
        self.known_s = self._told_s = config.time_offset_s
        self._time_offset = TimeOffset(self.known_s, config.time_offset_sigma_s)
        self._known_sigma_s = config.time_offset_sigma_s
        self.clock_away_s = 0.0
        self._given = fix_buffer.sensors
        self._expected = replace(self._given, antenna_sigma_m=0.0)  # until there are fixes
        self._told_antenna, self._told_missing = self._given.prior_antenna, False
        self.lever_arm = self._known_arm = LeverArm.within(self._told_antenna)  # now; before the newest map
        self.clock_watch = ClockWatch(config)

    @property
    def estimated_lever_arm(self) -> LeverArm | None:
        """The lever arm as known so far; None if it was measured."""
        return self.lever_arm if self._expected.antenna_sigma_m else None

    @property
    def unsure_of_antenna(self) -> bool:
        """Whether the antenna may be farther from where it is thought than a camera's own one."""
        return self._expected.antenna_sigma_m > self._config.unknown_antenna_sigma_m

    def settings(self, config: Config) -> Config:
        """Return the settings of a fit; once another clock was found, no rest of it is the likeliest."""
        if self.known_s == self._config.time_offset_s or self._config.estimate_time_offset == "no":
            return config
        found = {"estimate_time_offset": "yes", "time_offset_sigma_s": self._known_sigma_s}
        return config.model_copy(update={"sensors": config.sensors.model_copy(update=found)})

    def begin_map(self) -> None:
        """Let the fits of a new map begin with what those before have shown."""
        self.known_s, self._known_sigma_s = self._time_offset.time_offset_s, self._time_offset.sigma_s
        self._known_arm = self.lever_arm
        self.clock_away_s = 0.0
        self.clock_watch = ClockWatch(self._config)

    def begin_anew(self) -> None:
        """Forget what the fits of the newest map have shown of the lever arm."""
        self.lever_arm = self._known_arm

    def expect(self, fix_buffer: FixBuffer) -> bool:
        """Return whether the fits must begin anew, as less is known of the lever arm than was thought: a
        receiver with an antenna of its own may take a while until it has fixes that show that.

        Maps are placed by the fixes' buffer, which learns of it, too.
        """
        sensors = self._given
        if not self._antenna_known:
            sensors = sensors.with_unknown_antenna(self._config, fix_buffer.fixes.are_rtk)
        anew = sensors.antenna_sigma_m > self._expected.antenna_sigma_m
        if anew:
            self._expected = sensors
            self.lever_arm = self._known_arm = LeverArm.within(sensors.prior_antenna, sensors.antenna_sigma_m)
            self.clock_watch = ClockWatch(self._config)
        fix_buffer.sensors = replace(
            fix_buffer.sensors,
            antenna_sigma_m=self._expected.antenna_sigma_m,
            separate_antenna_sigma_m=self._expected.separate_antenna_sigma_m,
        )
        return anew

    def finds_another_clock(self, watched: ProfiledClock) -> bool:
        """Return whether the fits must begin anew, as another rest of the time offset was shown again."""
        self.clock_away_s = watched.away_s
        found = self.clock_watch.confirmed(watched.shown)
        if found is None:
            return False
        self.known_s += found.time_offset_s
        self._known_sigma_s = found.sigma_s
        self.clock_away_s = 0.0
        return True

    def follow(self, fused: FusedPath) -> TimeOffset:
        """Take over what a fit shows, and return its time offset."""
        rest, self.lever_arm = fused.time_offset, fused.lever_arm
        self._time_offset = TimeOffset(self.known_s + rest.time_offset_s, rest.sigma_s)
        return self._time_offset

    def news(self, time_offset: TimeOffset) -> tuple[str, ...]:
        """Return sentences for the user: if the time offset has changed by more than its standard deviation,
        if the lever arm is missing, and if fixes contradict the one that the user last heard of."""
        of_lever_arm = self._news_of_missing_lever_arm() + self._news_of_lever_arm(self.estimated_lever_arm)
        return self._news_of_time_offset(time_offset) + of_lever_arm

    def _news_of_time_offset(self, now: TimeOffset) -> tuple[str, ...]:
        if abs(now.time_offset_s - self._told_s) <= now.sigma_s:
            return ()
        self._told_s = now.time_offset_s
        return (
            f"the GPS positions are {now.time_offset_s:.2f} s older than their time stamps (standard "
            f"deviation {now.sigma_s:.2f} s); the fixes are shifted accordingly",
        )

    def _news_of_missing_lever_arm(self) -> tuple[str, ...]:
        if self._told_missing or self._antenna_known or not self.unsure_of_antenna:
            return ()
        self._told_missing = True
        return (
            "the antenna's place in the camera is not given: it is taken as zero, uncertain by "
            f"{self._expected.antenna_sigma_m:g} m, until the motion shows it: measure it and give "
            "camera_p_antenna in rig.yaml",
        )

    def _news_of_lever_arm(self, now: LeverArm | None) -> tuple[str, ...]:
        if now is None:
            return ()
        away = now.camera_p_antenna - self._told_antenna
        if away @ np.linalg.solve(now.covariance, away) <= _FAR_SIGMAS**2:
            return ()
        self._told_antenna = now.camera_p_antenna
        rows = zip(now.camera_p_antenna.tolist(), now.sigma_m.tolist(), _AXES, strict=True)
        place = ", ".join(f"{x:.2f} +- {sigma:.2f} m {axis}" for x, sigma, axis in rows)
        return (f"the motion shows that the antenna lies off the camera: {place} (standard deviations)",)
