"""Merging of the contents of several databases into one world."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vgps.errors import LandmarkDatabaseError
from vgps.geodesy import enu_T_enu
from vgps.landmarks.model import DatabaseContents, Keyframe, LandmarkViews
from vgps.model import FloatArray, GeodeticPoint


def merge(contents: Sequence[DatabaseContents]) -> DatabaseContents:
    """Merge all landmarks and keyframes into the ENU frame of the first.

    A place observed by several runs keeps the landmarks of each; ids are renumbered.

    Args:
        contents: At least one.

    Raises:
        LandmarkDatabaseError: The templates differ in size, or one of several worlds has no origin.
    """
    first = contents[0]
    moved: list[DatabaseContents] = []
    next_id = 0
    for part in contents:
        if part.views.templates.shape[1:] != first.views.templates.shape[1:]:
            raise LandmarkDatabaseError(
                f"has templates of {_size(part)} and of {_size(first)}",
                expected="one size",
                remedy="build all parts with the same patch_px and levels",
            )
        in_first = (
            part if part is first else _in_world(part, _transform(first.world_origin, part.world_origin))
        )
        moved.append(_renumbered(in_first, next_id))
        next_id += int(part.views.landmark.max()) + 1 if len(part.views) else 0
    return DatabaseContents(
        first.world_origin,
        _stacked([part.views for part in moved]),
        tuple(keyframe for part in moved for keyframe in part.keyframes),
        tuple(source for part in moved for source in part.sources),
    )


def _size(part: DatabaseContents) -> str:
    levels, side = part.views.templates.shape[1:3]
    return f"{levels} levels of {side} pixels"


def _transform(new: GeodeticPoint | None, old: GeodeticPoint | None) -> FloatArray:
    """Return new_T_old (4, 4) between two ENU frames, by way of ECEF."""
    if new is None or old is None:
        raise LandmarkDatabaseError(
            "a run without a world origin cannot be merged with another",
            remedy="smooth it with GPS, or give world_origin in rig.yaml",
        )
    return enu_T_enu(new, old)


def _in_world(part: DatabaseContents, new_T_old: FloatArray) -> DatabaseContents:
    rotation, shift = new_T_old[:3, :3], new_T_old[:3, 3]
    views = replace(
        part.views,
        world_p_landmark=part.views.world_p_landmark @ rotation.T + shift,
        world_p_camera=part.views.world_p_camera @ rotation.T + shift,
        world_v_column=part.views.world_v_column @ rotation.T,
        world_v_row=part.views.world_v_row @ rotation.T,
    )
    return replace(part, views=views, keyframes=tuple(_moved(key, new_T_old) for key in part.keyframes))


def _moved(keyframe: Keyframe, new_T_old: FloatArray) -> Keyframe:
    points = keyframe.world_p_landmark @ new_T_old[:3, :3].T + new_T_old[:3, 3]
    return replace(keyframe, world_T_camera=new_T_old @ keyframe.world_T_camera, world_p_landmark=points)


def _renumbered(part: DatabaseContents, first_id: int) -> DatabaseContents:
    views = replace(part.views, landmark=part.views.landmark + first_id)
    keyframes = tuple(replace(key, landmark=key.landmark + first_id) for key in part.keyframes)
    return replace(part, views=views, keyframes=keyframes)


def _stacked(parts: list[LandmarkViews]) -> LandmarkViews:
    return LandmarkViews(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])}
    )
