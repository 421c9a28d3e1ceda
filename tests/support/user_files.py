"""What users have instead of a recording folder, made of the simulated one."""

import shutil

import numpy as np
from bags import write_mcap, write_ros1, write_ros2
from log_bytes import ulog
from solutions import exact_run

from vgps.crs import egm96
from vgps.readers.recording import open_recording
from vgps.writers.export import ExportOptions, export
from vgps.writers.run_folder import write_run

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


def write_drone_video(recording, folder, name):
    """A drone's video and its subtitles, with calibration and rig; return the video."""
    shutil.copy(recording / "video.mp4", folder / "DJI_0001.MP4")
    shutil.copy(recording / "camera.yaml", folder)
    opened = open_recording(recording)
    (folder / "rig.yaml").write_text(f"camera_p_antenna: {opened.rig.camera_p_antenna.tolist()}\n")
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
    (folder / "DJI_0001.SRT").write_text("".join(parts))
    return folder / "DJI_0001.MP4"


def write_pictures(recording, folder):
    """A folder of every frame with its true pose in EXIF; calibration, rig and truth beside it."""
    run = exact_run(recording)
    write_run(run, folder.with_name("run of the pictures"))
    export(folder.with_name("run of the pictures"), "exif", folder, ExportOptions(geoid="egm96"))
    for name in ("camera.yaml", "truth.tum"):
        shutil.copy(recording / name, folder.parent)
    (folder.parent / "rig.yaml").write_text(f"world_origin: {list(run.world_origin)}\n")


def write_bag(recording, file):
    """A ROS 1 bag, a ROS 2 bag (a folder) or an MCAP file by its name; the rig beside it."""
    shutil.copy(recording / "rig.yaml", file.parent)
    writers = {".bag": write_ros1, ".mcap": write_mcap}
    writers.get(file.suffix, write_ros2)(recording, file)


def write_flight(recording, video, log):
    """A video with calibration and rig, and the log of an autopilot."""
    shutil.copy(recording / "video.mp4", video)
    for name in ("camera.yaml", "rig.yaml"):
        shutil.copy(recording / name, video.parent)
    opened = open_recording(recording)
    fixes = opened.gps
    rows = np.column_stack([fixes.latitude_deg, fixes.longitude_deg, fixes.height_m])
    begin_s = opened.rig.video_start_utc.timestamp() + fixes.t_s[0]
    log.write_bytes(ulog(rows.tolist(), begin_s, step_s=float(np.median(np.diff(fixes.t_s)))))
