# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A camera that whips around
#
# Matsuda 2007 localises a camera against a landmark database while it turns so fast that every frame is
# blurred. A place is surveyed once, slowly, with video and GPS; afterwards any camera with a gyro is placed
# there without GPS. Each frame goes through five steps:
#
# | step | what | ablation |
# |---|---|---|
# | A | the gyro rotates the last *estimated* pose to this frame | |
# | B | landmarks are chosen where the prediction puts them | (1) where the last pose puts them |
# | C | their templates are blurred along the motion that the gyro measured | (2) templates as stored |
# | D | each is searched by normalised cross-correlation in a window by its depth | (3) one window for all |
# | E | RANSAC, PnP, least reprojection error | |
#
# Here the experiment is small: a street is simulated and walked slowly with a sharp camera, then again with
# the shutter open all the time while the camera swings at up to 120 deg/s. The same for rates from 0 to
# 300 deg/s is `scripts.experiments.matsuda.rates`, and on a real drive `scripts.experiments.matsuda.table1`.

# %%
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import vgps
from vgps.config import LandmarksConfig, LocalizationConfig
from vgps.geometry import project
from vgps.landmarks.build import build_database
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.localization import Localizer
from vgps.localization.prediction import MotionState, exposure_motion_px
from vgps.localization.template_matching import match_templates
from vgps.localization.template_rendering import render_templates
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, GpsConfig, simulate

plt.rcParams.update({"figure.dpi": 90, "axes.grid": True, "grid.alpha": 0.3, "font.size": 9})

# %% [markdown]
# ## Survey and database
#
# Four seconds of a walk, of which the fast camera walks the first two. The survey swings slowly (30 deg/s)
# with a short exposure, has RTK-fix throughout, and is smoothed as any recording is. Five levels of templates
# reach far enough around a landmark for what a long blur mixes into it.

# %%
SWING_DEG, PEAK_DEG_S = 40.0, 120.0
SURVEY_S, FAST_S = 4.0, 2.0
slow = replace(
    SCENES["spin"],
    width=300,
    height=200,
    focal_px=260.0,
    bends=(),
    texture_scale=0.5,
    speed=((0.0, 1.5), (SURVEY_S, 1.5)),
    spin_deg_s=30.0,
    spin_period_s=np.pi * SWING_DEG / 30.0,
    gps=GpsConfig(fix_share=0.5, interval_s=0.5),
)
fast = replace(
    slow,
    speed=((0.0, 1.5), (FAST_S, 1.5)),
    spin_deg_s=PEAK_DEG_S,
    spin_period_s=np.pi * SWING_DEG / PEAK_DEG_S,
)
scratch = tempfile.TemporaryDirectory()
here = Path(scratch.name)
simulate(here / "survey", replace(slow, exposure_s=0.0025, eye_m=1.65))
simulate(here / "fast", fast)

survey = vgps.open_recording(here / "survey")
contents = build_database(vgps.smooth(survey), survey, "all", LandmarksConfig(levels=5))
write_database(contents, here / "street.vgps")
print(f"{len(np.unique(contents.views.landmark))} landmarks, {len(contents.views)} views")

# %% [markdown]
# ## What the fast camera sees
#
# With the shutter open for the whole interval, a turn of 120 deg/s smears everything over 8 degrees.

# %%
recording = vgps.open_recording(here / "fast")
truth = read_trajectory(here / "fast" / "truth.tum", video_start_s=0.0).world_T_camera
frames = list(recording.video.frames())
turned = truth[:-1, :3, :3].transpose(0, 2, 1) @ truth[1:, :3, :3]
step_deg = np.degrees(np.arccos(np.clip((np.trace(turned, axis1=1, axis2=2) - 1) / 2, -1, 1)))
rate_deg_s = np.append(step_deg, step_deg[-1]) * fast.fps
sharp, smeared = int(rate_deg_s.argmin()), int(rate_deg_s[:-1].argmax())

figure, axes = plt.subplots(1, 2, figsize=(9, 3.1), layout="constrained")
for axis, k in zip(axes, (sharp, smeared), strict=True):
    axis.imshow(frames[k].gray, cmap="gray", vmin=0, vmax=255)
    axis.set(title=f"frame {k}, {rate_deg_s[k]:.0f} deg/s", xticks=[], yticks=[])
plt.show()

# %% [markdown]
# ## Blurring the templates as the camera was (Fig. 5)
#
# At the true pose of the smeared frame: what the database holds, the same blurred along each landmark's own
# motion, and the picture there, for the landmarks that match best. Correlations over all landmarks follow.

# %%
config, camera = LocalizationConfig(), recording.camera
database = LandmarkDatabase.open(here / "street.vgps", config.selection)
localizer = Localizer(recording, database, config)


def compared(k):
    """Templates as stored and as blurred at frame k's true pose, and where and how well they match."""
    views = database.views(truth[k], camera, max_landmarks=config.max_landmarks)
    motion = MotionState(t_s=frames[k].t_s, world_T_camera=truth[k])
    blur = exposure_motion_px(
        camera.K, motion, localizer.rotations, frames[k].t_s, fast.exposure_s, views.world_p_landmark
    )
    uv, _ = project(camera.K, truth[k], views.world_p_landmark)
    image, radius = localizer.undistort(frames[k].gray), np.full(len(views), 3.0)
    templates = [render_templates(camera.K, truth[k], views, b, 15) for b in (np.zeros_like(blur), blur)]
    return image, templates, [match_templates(image, one, uv, radius) for one in templates]


image, templates, matches = compared(smeared)
best = [
    i for i in np.argsort(-matches[1].correlation) if (np.abs(matches[1].uv_px[i] - (150, 100)) < 80).all()
]
figure, axes = plt.subplots(3, 6, figsize=(9, 4.6), layout="constrained")
for column, i in zip(axes.T, best, strict=False):
    u, v = np.round(matches[1].uv_px[i]).astype(int)
    shown = (templates[0][i], templates[1][i], image[v - 7 : v + 8, u - 7 : u + 8])
    names = (f"{matches[0].correlation[i]:.2f}", f"{matches[1].correlation[i]:.2f}", "")
    for axis, picture, name in zip(column, shown, names, strict=True):
        axis.imshow(picture, cmap="gray")
        axis.set(title=name, xticks=[], yticks=[])
for axis, name in zip(axes[:, 0], ("stored", "re-blurred", "frame"), strict=True):
    axis.set_ylabel(name)
plt.show()

# %% [markdown]
# ## Tracking
#
# The tracker starts without a pose and gets nothing but frames and gyro. A frame counts as held if its pose
# is right to half a metre and was not found anew by descriptors.

# %%
PAPER = {"estimator": "frame", "blur": "interval"}
VARIANTS = {
    "graph (default)": {},
    "Matsuda 2007 (A)-(E)": PAPER,
    "(1) selected by the last pose": PAPER | {"select": "last_pose"},
    "(2) templates not blurred": PAPER | {"blur": "none"},
}
results = {}
for name, changes in VARIANTS.items():
    settings = LocalizationConfig.model_validate(changes)
    with LandmarkDatabase.open(here / "street.vgps", settings.selection) as opened:
        tracker = Localizer(recording, opened, settings)
        results[name] = [tracker.add(frame.t_s, tracker.undistort(frame.gray)) for frame in frames]

figure, (counts, errors) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
for name, tracked in results.items():
    error = np.array(
        [np.linalg.norm(f.world_T_camera[:3, 3] - t[:3, 3]) for f, t in zip(tracked, truth, strict=True)]
    )
    followed = np.array([f.tracked and (k == 0 or not f.recovered) for k, f in enumerate(tracked)])
    held = followed & (error < 0.5)
    count = np.array([len(f.observations) for f in tracked]) * held
    order = np.argsort(rate_deg_s)
    counts.plot(rate_deg_s[order], count[order], ".", label=name)
    errors.semilogy(np.arange(len(tracked)), np.where(held, error, np.nan), ".-", lw=0.8, label=name)
    print(f"{name:32} {held.sum()} of {len(held)} frames held, median error {np.median(error[held]):.3f} m")
counts.set(xlabel="angular rate [deg/s]", ylabel="landmarks that agree", title="Landmarks per frame (Fig. 4)")
errors.set(xlabel="frame", ylabel="position error [m]", title="Frames held")
errors.legend(fontsize=7)
plt.show()

# %%
median = np.array(
    [[np.median(match.correlation) for match in matches] for *_, matches in map(compared, range(len(frames)))]
).T
figure, axis = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
for values, name in zip(median, ("templates as stored", "re-blurred"), strict=True):
    axis.plot(rate_deg_s, values, ".", label=name)
axis.set(
    xlabel="angular rate [deg/s]",
    ylabel="median correlation",
    title="At the true poses (Fig. 5)",
    ylim=(0, 1),
)
axis.legend()
plt.show()
database.close()
scratch.cleanup()

# %% [markdown]
# Blurred templates keep their correlation at every rate, stored ones lose it as soon as the image moves by
# some pixels; choosing and warping landmarks by the last pose fails once a turn takes them out of their
# windows.
