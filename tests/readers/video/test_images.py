from pathlib import Path

import av
import numpy as np
import pytest
from clips import picture, shade
from PIL import Image

from vgps.camera import centred_camera, row_shares
from vgps.errors import VideoError
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.gopro.lens import with_readout
from vgps.readers.video.images import ImageFolder, list_images


def save(path: Path, index: int, size: tuple[int, int] = (64, 48)) -> None:
    av.VideoFrame.from_ndarray(picture(index, *size), "rgb24").save(str(path))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    images = tmp_path / "images"
    images.mkdir()
    for index in (0, 2, 10):
        save(images / f"f{index}.png", index)
    (images / "notes.txt").write_text("not an image")
    return images


def test_images_are_sorted_by_number(folder):
    assert [file.name for file in list_images(folder)] == ["f0.png", "f2.png", "f10.png"]


def test_times_by_frame(folder):
    (folder / "frame_times.csv").write_text("frame,t_s\n0,3.0\n1,3.5\n2,4.25\n")
    video = ImageFolder(folder)
    frames = list(video.frames())
    assert [frame.t_s for frame in frames] == video.times_s.tolist() == [0.0, 0.5, 1.25]
    assert video.start_s == 3.0
    assert [int(frame.gray[40, 40]) for frame in frames] == pytest.approx(
        [shade(i) for i in (0, 2, 10)], abs=1
    )
    assert (video.width, video.height) == (64, 48)


def test_times_by_file_beside_the_folder(folder):
    (folder.parent / "frame_times.csv").write_text("file,t_s\nf10.png,0\nf0.png,1\n")
    frames = list(ImageFolder(folder).frames())
    assert [int(frame.gray[40, 40]) for frame in frames] == pytest.approx([shade(10), shade(0)], abs=1)


def test_a_damaged_image_is_black_with_a_warning(folder):
    (folder / "f2.png").write_bytes(b"no image")
    (folder / "frame_times.csv").write_text("frame,t_s\n0,0\n1,1\n2,2\n")
    video = ImageFolder(folder)
    frames = list(video.frames())
    assert [frame.gray.any() for frame in frames] == [True, False, True]
    assert np.shape(frames[1].gray) == (48, 64)
    assert video.warnings == ("1 of 3 images cannot be decoded, first f2.png",)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (None, "add frame_times.csv"),
        ("frame,t_s\n0,0\n", "1 times; expected 3"),
        ("file,t_s\nf0.png,0\nf1.png,1\n", "no image f1.png"),
        ("frames,t_s\n0,0\n", "did you mean frames"),
        ("frame\n0\n", "no column t_s"),
    ],
)
def test_times_and_images_that_do_not_match_are_refused(folder, table, message):
    if table is not None:
        (folder / "frame_times.csv").write_text(table)
    with pytest.raises(VideoError, match=message):
        ImageFolder(folder)


def test_an_image_of_another_size_is_refused(folder):
    save(folder / "f2.png", 2, (32, 48))
    (folder / "frame_times.csv").write_text("frame,t_s\n0,0\n1,1\n2,2\n")
    with pytest.raises(VideoError, match=r"f2\.png: an image of 32 x 48; expected 64 x 48"):
        list(ImageFolder(folder).frames())


@pytest.mark.parametrize(("orientation", "turns"), [(1, 0), (3, 2), (6, 3), (8, 1)])
def test_the_rows_of_a_turned_picture_are_its_columns(tmp_path, orientation, turns):
    images = tmp_path / "images"
    images.mkdir()
    rows = np.tile(np.linspace(0, 255, 48).astype(np.uint8)[:, None], (1, 64))
    exif = Image.Exif()
    exif[0x0112] = orientation
    for index in range(2):
        Image.fromarray(rows).save(images / f"{index:06d}.jpg", exif=exif)
    (tmp_path / "frame_times.csv").write_text("frame,t_s\n0,0.0\n1,0.1\n")
    video = ImageFolder(images)
    assert video.quarter_turns == turns
    size = (video.width, video.height)
    lens = with_readout(centred_camera("opencv", size, 60.0), Telemetry(images), video.quarter_turns)
    gray = next(iter(video.frames())).gray.astype(float)
    v, u = (index.ravel() for index in np.indices(gray.shape))
    order = np.corrcoef(row_shares(lens, np.column_stack([u, v]).astype(float)), gray[v, u])[0, 1]
    assert abs(order) > 0.99 and (order < 0) == (turns >= 2)  # then its readout is negative


def test_mirrored_pictures_are_refused(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 2
    Image.fromarray(np.zeros((40, 60, 3), np.uint8)).save(tmp_path / "0.jpg", exif=exif)
    (tmp_path / "frame_times.csv").write_text("frame,t_s\n0,0\n")
    with pytest.raises(VideoError, match=r"mirrors the picture \(2\); expected none, or one"):
        ImageFolder(tmp_path)
