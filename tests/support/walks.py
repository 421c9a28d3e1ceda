"""Drives of any length from the small recording."""

import numpy as np

import vgps
from vgps.geodesy import to_geodetic
from vgps.online import OnlineSmoother
from vgps.online.replay import fixes_of
from vgps.readers.trajectory import read_trajectory


class ToAndFro:
    """The small recording forwards, backwards, forwards ... with a true fix every half second."""

    def __init__(self, folder):
        self.opened = vgps.open_recording(folder)
        self.images = [frame.gray for frame in self.opened.video.frames()]
        self.true = read_trajectory(folder / "truth.tum").world_T_camera
        self.black = np.zeros_like(self.images[0])

    def row(self, index):
        last = len(self.images) - 1
        return last - abs(index % (2 * last) - last)

    def drive(self, frames, config, silent=range(0), dark=range(0), each=None):
        """Smoother and estimates after so many frames; ``silent`` without fixes, ``dark`` without light."""
        smoother, estimates = OnlineSmoother(self.opened.camera, self.opened.rig, config), []
        template = next(fixes_of(self.opened.gps))
        for index in range(frames):
            t_s, true = index / 15, self.true[self.row(index)]
            if index % 8 == 0 and index not in silent:
                antenna = true[:3, 3] + true[:3, :3] @ self.opened.rig.camera_p_antenna
                place = to_geodetic(self.opened.rig.world_origin, antenna)
                latitude, longitude, height = (float(x) for x in place)
                smoother.add_fix(
                    template._replace(
                        t_s=t_s, latitude_deg=latitude, longitude_deg=longitude, height_m=height
                    )
                )
            image = self.black if index in dark else self.images[self.row(index)]
            estimates.append(smoother.add_frame(t_s, image))
            smoother.refine()
            if each is not None:
                each(index, smoother)
        return smoother, estimates

    def away(self, estimates):
        return [
            float(np.linalg.norm(e.global_T_camera[:3, 3] - self.true[self.row(e.frame), :3, 3]))
            for e in estimates
            if e.posed
        ]
