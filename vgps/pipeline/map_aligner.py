"""The place of a new map in the world: by control points, or by fixes once they suffice."""

from vgps.gps.fix_buffer import FixBuffer
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.smoothing.alignment.map_alignment import AlignmentResult, align_to_control, align_to_fixes
from vgps.smoothing.context import SmoothingContext
from vgps.tracking.control_points import control_poses


class MapAligner:
    """Alignment of maps as frames and fixes come.

    Args:
        context: Camera, control points and settings.
        fix_buffer: The fixes so far.
    """

    def __init__(self, context: SmoothingContext, fix_buffer: FixBuffer) -> None:
        self._config, self._fix_buffer = context.config, fix_buffer
        self._control_poses = control_poses(context.controls, context.camera.K)

    def align(self, local_map: LocalMap, t_s: FloatArray) -> AlignmentResult | None:
        """Return the alignment of a map, None while control points and fixes do not suffice.

        Args:
            local_map: The map.
            t_s: Times of all frames of the video so far; fixes count once, at the view after them.
        """
        config, fix_buffer = self._config, self._fix_buffer
        result = align_to_control(local_map, self._control_poses, config.start.min_control_travel_m)
        view_before = max(int(local_map.view_frames[-2]), 0)  # frames that stand add no view
        if result is None and fix_buffer.has_new(float(t_s[view_before]), float(t_s[-1])):
            antenna, sigma_m = fix_buffer.sensors.prior_antenna, fix_buffer.sensors.antenna_sigma_m
            return align_to_fixes(local_map, fix_buffer.corrected, antenna, config, sigma_m)
        return result
