"""The maps of a video: those that tracking has left, the one it extends, and one that may follow it."""

from collections.abc import Callable, Mapping
from typing import Any

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate
from vgps.mapping.retention import RetentionPolicy, RetiredPoses, retire_before, retire_map
from vgps.model import FloatArray
from vgps.pipeline.map_builder import MapBuilder


class MapSequence:
    """Maps in order of time.

    Attributes:
        started: Finished maps, and the current one once it has started; each has the poses of its own frames.
        current: The map that the newest frames extend, or may start; None before its first view.
        following: A map that may start while tracking of the current one is lost.
    """

    def __init__(self) -> None:
        self.started: list[LocalMap] = []
        self.current: MapBuilder | None = None
        self.following: MapBuilder | None = None

    @property
    def newest(self) -> LocalMap | None:
        """The current map, once it has started."""
        return self.current.local_map if self.current is not None and self.current.started else None

    @property
    def searching(self) -> bool:
        """Whether a lost camera is searched."""
        return any(one is not None and one.relocaliser for one in (self.current, self.following))

    def list_newest(self) -> None:
        """Add the current map to the started ones when it has started."""
        if (newest := self.newest) is not None and newest not in self.started:
            self.started.append(newest)

    def follow(self, lost: LocalMap, t_s: FloatArray) -> str:
        """Go on with the following map, which has started, after a lost one, and return a warning.

        Args:
            lost: The map before it.
            t_s: Times of all frames of the video so far.
        """
        assert self.following is not None
        last, first = lost.next_frame - 1, self.following.local_map.first_posed
        self.current, self.following = self.following, None
        return (
            f"tracking was lost after frame {last} ({t_s[last]:.2f} s) and could not be resumed; "
            f"a new map begins at frame {first} ({t_s[first]:.2f} s)"
        )

    def undistort_again(self, undistorted: Callable[[FloatArray], FloatArray], optimised: LocalMap) -> None:
        """Give the observations of all maps those of a refined camera, but for the one optimised with it."""
        following = [] if self.following is None else [self.following.local_map]
        for local_map in (*self.started, *following):
            if local_map is not optimised:
                local_map.apply(MapUpdate(undistorted=undistorted))

    def discard(self, horizon_s: float, retention: RetentionPolicy) -> list[RetiredPoses]:
        """Discard finished maps and what the policy does not keep of the others; return the discarded poses.

        Args:
            horizon_s: Time of the oldest pose to keep.
            retention: The policy.
        """
        newest = self.newest
        retired = [retire_map(one) for one in self.started if one is not newest]
        self.started = [] if newest is None else [newest]
        for builder in (self.current, self.following):
            if builder is not None:
                part = retire_before(builder.local_map, horizon_s, retention)
                retired += [part] if builder.started else []
        return [part for part in retired if len(part.poses)]

    def state(self) -> dict[str, Any]:
        """Return what :meth:`restore` takes over."""
        return {"current": self.current, "next": self.following, "maps": self.started}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a state."""
        self.current, self.following, self.started = state["current"], state["next"], state["maps"]
