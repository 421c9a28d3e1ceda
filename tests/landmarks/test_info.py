from pathlib import Path

import numpy as np
from synthetic_landmarks import ORIGIN, random_contents
from whole_database import all_views

from vgps.landmarks.database_writer import write_database
from vgps.landmarks.info import database_info


def test_the_summary_counts_what_was_written(tmp_path: Path) -> None:
    contents = random_contents(landmarks=90, keyframes=3)
    path = tmp_path / "landmarks.vgps"
    write_database(contents, path)
    info = database_info(path)
    assert (info.path, info.file_bytes, info.schema_version) == (path, path.stat().st_size, 1)
    assert (info.landmarks, info.views, info.keyframes) == (90, len(contents.views), 3)
    assert info.descriptors == sum(len(keyframe.landmark) for keyframe in contents.keyframes)
    assert (info.levels, info.patch_px) == contents.views.templates.shape[1:3]
    assert (info.world_origin, info.sources) == (ORIGIN, contents.sources)
    points = all_views(path).world_p_landmark
    np.testing.assert_array_equal(info.extent_m, [points.min(axis=0), points.max(axis=0)])
    assert len(info.sha256) == 64


def test_the_sha256_is_that_of_the_contents(tmp_path: Path) -> None:
    digests = []
    for name, seed in (("one", 1), ("same", 1), ("other", 2)):
        write_database(random_contents(seed), tmp_path / name)
        digests.append(database_info(tmp_path / name).sha256)
    assert digests[0] == digests[1] != digests[2]
