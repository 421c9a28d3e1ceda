"""A drone's video with its subtitles, in every dialect of the files in dji_srt: one command each."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from vgps.crs import egm96
from vgps.evaluation import evaluate
from vgps.readers.recording import open_recording

# a text of a subtitle by the file whose dialect it is; heights of some are above the sea or the take-off
DIALECTS = {
    "MAVIC3": "[latitude: {lat:.7f}] [longitude: {lon:.7f}] [rel_alt: {up:.3f} abs_alt: {sea:.3f}]",
    "air2s": "[fnum : 280] [latitude: {lat:.7f}] [longitude: {lon:.7f}] [altitude: {sea:.6f}]",
    "m2zoom": "[latitude : {lat:.7f}] [longtitude : {lon:.7f}] [altitude: {sea:.6f}]",
    "mavic_2pro_new": "[ct : 5174] [latitude : {lat:.7f}] [longtitude : {lon:.7f}]",
    "mavic_pro": "HOME(8.4,49.0) 2017.08.05 14:11:51\nGPS({lon:.7f},{lat:.7f},16) BAROMETER:{up:.1f}",
    "matrice_300": "2022.06.21 16:06:17\nGPS({lon:.7f},{lat:.7f},0.0M) BAROMETER:{up:.1f}M",
    "old_format": "GPS({lon:.7f},{lat:.7f},16) Hb:{up:.1f} Hs:{up:.1f}",
    "p4_rtk": "F/5.6, SS 400, EV 0, GPS ({lon:.7f}, {lat:.7f}, 15), D 698.70m, H {up:.2f}m, H.S 0.00m/s",
}
DATED = "[latitude : {lat:.7f}] [longtitude : {lon:.7f}] [iso : 100] [fnum : 220]"


def subtitle(name, index, t_s, text):
    if name == "mavic_2_style":
        second = f"{50 + t_s:06.3f}".replace(".", ",")
        return f"{index}\n2017.08.05 14:11:{second},525\n{text}\n\n"
    clock = [f"00:00:{t:06.3f}".replace(".", ",") for t in (t_s, t_s + 0.5)]
    return f"{index}\n{clock[0]} --> {clock[1]}\n{text}\n\n"


@pytest.fixture
def drone(recording, tmp_path):
    """Return a function that makes a drone's recording of the simulated one: a video and its subtitles."""

    def made(name):
        shutil.copy(recording / "video.mp4", tmp_path / "DJI_0001.MP4")
        shutil.copy(recording / "camera.yaml", tmp_path)
        opened = open_recording(recording)
        (tmp_path / "rig.yaml").write_text(f"camera_p_antenna: {opened.rig.camera_p_antenna.tolist()}\n")
        log = opened.gps
        sea = log.height_m - egm96().height_m(log.latitude_deg, log.longitude_deg)
        up = log.height_m - log.height_m[0]
        values = np.column_stack([log.latitude_deg, log.longitude_deg, sea, up]).tolist()
        text = DIALECTS.get(name, DATED)
        parts = []
        for row, t_s in enumerate(log.t_s.tolist()):
            place = dict(zip(("lat", "lon", "sea", "up"), values[row], strict=True))
            # dates count from the first subtitle, which is at the start
            at_s = 0.0 if name == "mavic_2_style" and row == 0 else t_s
            parts.append(subtitle(name, row + 1, at_s, text.format(**place)))
        (tmp_path / "DJI_0001.SRT").write_text("".join(parts))
        return tmp_path / "DJI_0001.MP4"

    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", [*DIALECTS, "mavic_2_style"])
def test_one_command_smooths_a_drone_s_video(drone, recording, tmp_path, name):
    # the walk is shorter than the region of the class single needs: a survey gives a smaller one
    (tmp_path / "survey.yaml").write_text("single: {r_m: 0.5, h_m: 0.5}\n")
    words = [sys.executable, "-m", "vgps", "smooth", str(drone(name)), "--out", str(tmp_path / "run")]
    words += ["--survey", str(tmp_path / "survey.yaml")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    truth = recording / "truth.tum"
    # the run has the first fix as origin, the truth that of the simulation
    shutil.copy(truth, tmp_path / "truth.tum")
    opened = open_recording(recording)
    (tmp_path / "rig.yaml").write_text(f"world_origin: {list(opened.rig.world_origin)}\n")
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum")
    assert found.every_frame_posed and found.camera_horizontal_m.mean < 0.5
    if name in {"MAVIC3", "air2s", "m2zoom"}:
        assert found.camera_vertical_m.mean < 0.5
    elif name in {"mavic_2pro_new", "mavic_2_style"}:
        # the height is that of the origin, 0, and the shape of the path is the video's
        height = np.asarray(found.camera_error_m)[:, 2]
        assert np.std(height) < 0.5
