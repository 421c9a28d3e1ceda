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
# # What a receiver's fixes are worth
#
# The cylinder of Eq. (16), Kume 2010, needs a radius $r(p)$ and a half height $h(p)$ for each fix class
# $p$. The thesis measures them: a receiver stands still for five hours at 1 Hz, the mean of its RTK-fix
# epochs is taken for the truth, the worst 5 % are dropped horizontally and, separately, vertically, and the
# largest errors that remain are $r$ and $h$ (Table 4). `vgps survey LOG --out receiver.yaml` does that;
# this notebook does it step by step and then asks how far such numbers can be believed.

# %%
import os
import tempfile
from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle, Ellipse, Rectangle

import vgps
from vgps.config import SurveyConfig, read_survey
from vgps.model import FixClass
from vgps.simulate import SCENES, FixErrors
from vgps.simulate.receiver_errors import fit_gauss_markov
from vgps.simulate.sensor_config import FIX_ERRORS
from vgps.simulate.sensors import SimulatedFixes, gauss_markov, nmea
from vgps.survey import region, survey_logs
from vgps.survey.output import write_survey

plt.rcParams.update({"figure.dpi": 90, "axes.grid": True, "grid.alpha": 0.3, "font.size": 9})
COLOURS = {FixClass.RTK_FIX: "#2a9d8f", FixClass.RTK_FLOAT: "#e9a23b"}
scratch = Path(tempfile.mkdtemp())

# %% [markdown]
# ## The log
#
# Ten minutes of a real receiver at 1 Hz, if the test recordings are there (`VGPS_DATA` names their folder);
# else a simulated receiver with the same faults. Put the path of your own log here, in any format that
# `vgps.readers.gps` knows: NMEA, UBX, RTKLIB `.pos`, GPX, CSV.


# %%
def simulated_log(path: Path) -> Path:
    """Write the log of a static receiver: RTK-fix and RTK-float in turns, errors as in `FIX_ERRORS`."""
    rng = np.random.default_rng(0)
    runs = [(FixClass.RTK_FIX if k % 2 else FixClass.RTK_FLOAT, int(rng.integers(20, 60))) for k in range(16)]
    classes = tuple(name for name, count in runs for _ in range(count))
    errors = np.concatenate([gauss_markov(count, 1.0, FIX_ERRORS[name], rng) for name, count in runs])
    reported = np.array([FIX_ERRORS[name].reported_m for name in classes])
    t = np.arange(float(len(classes)))
    fixes = SimulatedFixes(
        t_s=t,
        fix_class=classes,
        world_p_antenna=np.zeros((len(t), 3)),
        error_m=errors,
        reported_m=reported,
        outlier=np.zeros(len(t), bool),
    )
    path.write_bytes(nmea(fixes, SCENES["walk"]))
    return path


data = Path(os.environ.get("VGPS_DATA", Path(vgps.__file__).parents[1] / "../shared/data"))
log = data / "survey" / "stationary.nmea"
if not log.is_file():
    log = simulated_log(scratch / "simulated.nmea")
survey = survey_logs([log])
print(log.name, dict(Counter(str(name) for name in survey.fix_class)))

# %%
rows = {name: np.array([one is name for one in survey.fix_class]) for name in COLOURS}
figure, panels = plt.subplots(2, 1, figsize=(9, 4), sharex=True, layout="constrained")
horizontal = np.hypot(*survey.errors_m[:, :2].T)
for name, colour in COLOURS.items():
    panels[0].plot(survey.t_s[rows[name]], horizontal[rows[name]], ".", color=colour, ms=4, label=str(name))
    panels[1].plot(survey.t_s[rows[name]], survey.errors_m[rows[name], 2], ".", color=colour, ms=4)
panels[0].set(ylabel="horizontal error [m]")
panels[1].set(ylabel="height error [m]", xlabel="time [s]")
panels[0].legend()
plt.show()

# %% [markdown]
# The error of RTK-float is nothing like white noise. It wanders for minutes, and jumps when the ambiguities
# settle elsewhere; over the length of a walk it is a bias. That is why the thesis does not pull the antenna
# to it.
#
# ## $r(p)$ and $h(p)$ (Table 4), and the ellipsoid of least volume (Table 5)

# %%
print("class       epochs   all: horiz / vert [m]   5 % dropped: r / h [m]   alpha / beta [m]")
for one in survey.classes:
    print(
        f"{one.fix_class:10s}  {one.epochs:6d}   {one.largest_m[0]:9.3f} / {one.largest_m[1]:<9.3f}"
        f"   {one.r_m:10.3f} / {one.h_m:<9.3f}   {one.ellipsoid.alpha_m:7.3f} / {one.ellipsoid.beta_m:.3f}"
    )
print("thesis, fix            0.793 / 0.677            0.029 / 0.041          0.025 / 0.055")
print("thesis, float         12.792 / 20.424           3.778 / 9.504          4.125 / 11.366")

# %% [markdown]
# ## Where the fixes lie (Figs 10 and 11)
#
# From above, with the circle of radius $r$; from the side, with the cylinder (solid) and the ellipsoid
# (dashed), which leaves as many epochs outside. The truth is the cross. In this log the cloud of RTK-float
# does not lie around the truth: its mean is off too, and ten minutes do not average that out.

# %%
by_class = {one.fix_class: one for one in survey.classes}
figure, panels = plt.subplots(2, 2, figsize=(9, 8), layout="constrained")
for (above, side), (name, colour) in zip(panels, COLOURS.items(), strict=True):
    errors, one = survey.errors_m[rows[name]], by_class[name]
    out = (np.hypot(*errors[:, :2].T) > one.r_m) | (np.abs(errors[:, 2]) > one.h_m)
    for chosen, shade in ((~out, colour), (out, "#bbbbbb")):
        above.plot(*errors[chosen, :2].T, ".", color=shade, ms=4)
        side.plot(errors[chosen, 0], errors[chosen, 2], ".", color=shade, ms=4)
    above.add_patch(Circle((0, 0), one.r_m, fill=False, lw=1.2))
    side.add_patch(Rectangle((-one.r_m, -one.h_m), 2 * one.r_m, 2 * one.h_m, fill=False, lw=1.2))
    size = (2 * one.ellipsoid.alpha_m, 2 * one.ellipsoid.beta_m)
    side.add_patch(Ellipse((0, 0), *size, fill=False, lw=1.2, ls="--"))
    for axes in (above, side):
        axes.plot(0, 0, "k+", ms=11)
        axes.set_aspect("equal", adjustable="datalim")
    above.set(xlabel="east [m]", ylabel="north [m]", title=f"{name}, r = {one.r_m:.3f} m")
    side.set(xlabel="east [m]", ylabel="up [m]", title=f"{name}, h = {one.h_m:.3f} m")
plt.show()

# %% [markdown]
# ## How much to drop
#
# 5 % is the thesis's choice. The more is dropped, the tighter the region, and the more good fixes lie
# outside it and push the path. A knee, as the height of RTK-fix has near 4 % in the real log, shows where
# outliers end; RTK-float has none, its errors are large by nature.

# %%
shares = np.linspace(0, 0.3, 61)
figure, panels = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
for axes, (name, colour) in zip(panels, COLOURS.items(), strict=True):
    sizes = np.array([region(survey.errors_m[rows[name]], share) for share in shares])
    axes.plot(100 * shares, sizes[:, 0], color=colour, label="r")
    axes.plot(100 * shares, sizes[:, 1], color=colour, ls="--", label="h")
    axes.axvline(5, color="k", lw=0.8)
    axes.set(xlabel="dropped [%]", ylabel="[m]", title=str(name), ylim=(0, None))
    axes.legend()
plt.show()

# %% [markdown]
# ## How long an error stays what it is
#
# The autocorrelation of the RTK-float errors, about the truth, and the first-order Gauss-Markov process
# that is most like it. An error with a correlation time of $T$ seconds needs about $2T$ seconds until it is
# a new one, so the epochs of this log are worth few independent ones.


# %%
def autocorrelation(t_s: np.ndarray, error_m: np.ndarray, most_s: int) -> np.ndarray:
    """Return it at every lag up to ``most_s`` seconds, over the pairs that there are; NaN without any."""
    second = np.round(t_s - t_s[0]).astype(int)
    series = np.full(second[-1] + 1, np.nan)
    series[second] = error_m
    products = [np.nanmean(series[lag:] * series[: len(series) - lag]) for lag in range(most_s)]
    return np.array(products) / products[0]


name = FixClass.RTK_FLOAT
t_s, errors = survey.t_s[rows[name]], survey.errors_m[rows[name]]
lags = np.arange(min(120, int(t_s[-1] - t_s[0]) // 2))
figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
fits = [fit_gauss_markov(t_s, errors[:, axis]) for axis in range(3)]
for axis, (label, shade) in enumerate(
    zip(("east", "north", "up"), ("#c8553d", "#5a6acf", "#2a9d8f"), strict=True)
):
    axes.plot(lags, autocorrelation(t_s, errors[:, axis], len(lags)), color=shade, lw=1)
    fit = fits[axis]
    fitted = f"{label}: {fit.sigma_m:.2f} m ± {100 * fit.sigma_doubt:.0f} %, {fit.correlation_s:.0f} s"
    axes.plot(lags, np.exp(-lags / fit.correlation_s), "--", color=shade, lw=1, label=fitted)
axes.axhline(0, color="k", lw=0.8)
axes.set(xlabel="lag [s]", ylabel="autocorrelation", title=f"{name}: {len(t_s)} epochs")
axes.legend(fontsize=8)
plt.show()
for one in survey.classes:
    print(f"{one.fix_class}: {one.epochs} epochs are worth {one.independent:.0f} independent ones")

# %% [markdown]
# ## What another day would say
#
# Take the fitted process for the truth, and let it write logs as long as this one, and of five hours as in
# the thesis. Each gives an $r$ of its own. Minutes measure $r$ to a quarter of itself at best, hours to a
# few per cent; and that is with errors of one and the same process, while a real receiver's depend on the
# hour, the sky and the walls around. So survey for hours, at several times of day, and where you will
# record.

# %%
rng = np.random.default_rng(1)
sigma_h = float(np.sqrt(np.mean([fit.sigma_m**2 for fit in fits[:2]])))
correlation = float(np.mean([fit.correlation_s for fit in fits[:2]]))
process = FixErrors(sigma_h_m=sigma_h, sigma_v_m=fits[2].sigma_m, correlation_s=correlation)
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for epochs, logs, shade in ((len(t_s), 200, "#e9a23b"), (18_000, 8, "#5a6acf")):
    radii = [region(gauss_markov(epochs, 1.0, process, rng), 0.05)[0] for _ in range(logs)]
    low, high = np.quantile(radii, [0.05, 0.95])
    label = f"{epochs} epochs: 90 % of logs between {low:.1f} and {high:.1f} m"
    axes.hist(
        radii, bins=np.linspace(0, 4.5 * sigma_h, 40), density=True, color=shade, alpha=0.6, label=label
    )
axes.axvline(by_class[name].r_m, color="k", lw=1.2, label=f"this log: {by_class[name].r_m:.1f} m")
axes.set(xlabel="r of RTK-float [m]", yticks=[])
axes.legend(fontsize=8)
plt.show()

# %% [markdown]
# ## To the smoother
#
# The survey as a file, for `vgps smooth RECORDING --survey receiver.yaml --out RUN`, as the smoother reads
# it.

# %%
write_survey(survey, SurveyConfig(), scratch / "receiver.yaml")
for name, size in read_survey(scratch / "receiver.yaml").items():
    print(f"{name}: {{r_m: {size.r_m}, h_m: {size.h_m}}}")
