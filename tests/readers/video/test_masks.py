"""Masks are found by the names of the images, or by the numbers of the frames."""

from pathlib import Path

import numpy as np
import pytest
from clips import write_clip
from PIL import Image

from vgps.errors import RecordingError
from vgps.readers.sources import open_video
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.masks import MaskFolder, find_masks
from vgps.readers.video.video_file import VideoFile

SIZE = (64, 48)


def save(path: Path, hidden_columns: int, size: tuple[int, int] = SIZE) -> None:
    """A mask that hides the first columns."""
    mask = np.full(size[::-1], 255, np.uint8)
    mask[:, :hidden_columns] = 0
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(mask).save(path)


@pytest.fixture
def images(tmp_path: Path) -> ImageFolder:
    for index in range(3):
        save(tmp_path / "images" / f"f{index}.jpg", 0)
    (tmp_path / "frame_times.csv").write_text("frame,t_s\n0,0.0\n1,0.1\n2,0.2\n")
    return ImageFolder(tmp_path / "images")


def hidden(masks: MaskFolder, index: int) -> int | None:
    mask = masks.of_frame(index)
    return None if mask is None else int((~mask).sum()) // SIZE[1]


def test_masks_have_the_names_of_their_images_as_in_colmap(images, tmp_path):
    save(tmp_path / "masks" / "f1.jpg.png", 5)
    save(tmp_path / "masks" / "f2.png", 7)
    masks = MaskFolder(tmp_path / "masks", images)
    assert [hidden(masks, index) for index in range(3)] == [None, 5, 7]


def test_masks_of_a_video_are_numbered_and_one_may_serve_all_frames(tmp_path):
    video = VideoFile(write_clip(tmp_path / "video.mp4", frames=4))
    save(tmp_path / "masks" / "000002.png", 5)
    save(tmp_path / "masks" / "video.mp4.png", 9)
    masks = MaskFolder(tmp_path / "masks", video)
    assert [hidden(masks, index) for index in range(4)] == [9, 9, 5, 9]


def test_a_folder_of_masks_is_no_folder_of_images(images, tmp_path):
    save(tmp_path / "masks" / "f1.jpg.png", 5)
    assert open_video(tmp_path).path == images.path
    assert find_masks(tmp_path, images) is not None
    assert find_masks(tmp_path / "images", images) is None


@pytest.mark.parametrize("name", ["f9.jpg.png", "3.png", "².png"])
def test_a_mask_of_no_frame_is_refused(images, tmp_path, name):
    save(tmp_path / "masks" / name, 5)
    with pytest.raises(RecordingError, match=rf"{name}.*mask of no frame.*name of an image"):
        MaskFolder(tmp_path / "masks", images)


def test_a_mask_of_another_size_or_that_is_no_picture_is_refused(images, tmp_path):
    save(tmp_path / "masks" / "f0.jpg.png", 5, (32, 24))
    (tmp_path / "masks" / "f1.jpg.png").write_bytes(b"nothing")
    masks = MaskFolder(tmp_path / "masks", images)
    with pytest.raises(RecordingError, match=r"f0.jpg.png.*32 x 24.*64 x 48"):
        masks.of_frame(0)
    with pytest.raises(RecordingError, match=r"f1.jpg.png.*cannot be read"):
        masks.of_frame(1)
