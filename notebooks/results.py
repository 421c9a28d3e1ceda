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
# # Measured results
#
# Every file in `results/` holds the rows of one measurement: one command, one commit, one machine. Each table
# and figure below is drawn from one file, and says which. How to measure again: `scripts/README.md`.
#
# No recording used here has video, its own GPS and an independent truth at once: errors of fixes are replayed
# from real receivers onto the true path of KITTI odometry 03.

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown, display

sys.path.append("..")  # scripts: they are no part of the installed package
from scripts.common.markdown import table
from scripts.common.results import read_results

plt.rcParams.update({"figure.dpi": 90, "axes.grid": True, "grid.alpha": 0.3, "font.size": 9})
FILES = {file.stem: file for file in sorted(Path("results").glob("*.json"))}


def load(name):
    """Return a result, and show what it answers and where it comes from."""
    found = read_results(FILES.pop(name))
    machine = found["machine"]
    source = f"`{found['command']}`, commit {found['commit'][:10]}, {found['date'][:10]}"
    host = f"{machine['cpu']}, {machine['cores']} cores, load {machine['load']}, Python {machine['python']}"
    display(Markdown(f"**{found['question']}**\n\n{source}; {host}"))
    return found


def text(value):
    """Return a value as a table shows it."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {text(one)}" for name, one in value.items())
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return "" if value is None else str(value)


def show(rows):
    """Show rows as a table, a column per name."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    cells = [[text(row.get(name)) for name in names] for row in rows]
    display(Markdown(table([name.replace("_", " ") for name in names], cells)))


def pivot(rows, index, column, value):
    """Return the names down and across, and the mean values (I, C) over the other columns."""
    down, across = (list(dict.fromkeys(row[name] for row in rows)) for name in (index, column))
    cells = [
        [np.mean([row[value] for row in rows if row[index] == i and row[column] == c]) for c in across]
        for i in down
    ]
    return down, across, np.array(cells)


# %% [markdown]
# ## The whole program
#
# Unaligned errors of the camera centre. `gps_float` and `gps_float_b` have RTK-fix in the first and last 8 s
# and RTK-float between; `gps_outliers` is `gps_float` with twelve wrong fixes, `gps_late` is `gps_float` with
# positions 0.37 s older than their time stamps.

# %%
accuracy = load("accuracy")
show(accuracy["rows"])
logs, _, mean_m = pivot(accuracy["rows"], "log", "seed", "mean_m")
_, _, max_m = pivot(accuracy["rows"], "log", "seed", "max_m")
figure, axes = plt.subplots(figsize=(7, 2.6), layout="constrained")
axes.barh(logs, np.median(mean_m, axis=1), color="#2a9d8f", label="mean of the median seed")
axes.plot(max_m.max(axis=1), range(len(logs)), "k|", ms=12, label="largest error of all seeds")
axes.invert_yaxis()
axes.set(xlabel="unaligned camera error [m]", xlim=(0, None))
figure.legend(loc="outside upper center", ncols=2)
plt.show()

# %% [markdown]
# ## GPS models
#
# All models share the front end run of a log, and all but Cauchy its outlier detection; the video alone has a
# front end of its own, placed by its first 30 true poses. Where fixes are biased, regions (D, cylinder) do
# better than sigmas (C), and their shape hardly matters; where every fix is as good as its sigma, C does.

# %%
if "models" in FILES:
    models = load("models")
    names, logs, mean_m = pivot(models["rows"], "model", "log", "mean_m")
    cells = [[name, *(f"{x:.3f}" for x in row)] for name, row in zip(names, mean_m, strict=True)]
    display(Markdown(table(["mean error [m]", *logs], cells)))
    figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
    for k, name in enumerate(names):
        axes.plot(mean_m[k], np.arange(len(logs)) + 0.1 * (k - len(names) / 2), "o", label=name)
    axes.set_yticks(range(len(logs)), logs)
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="mean unaligned camera error [m]")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    plt.show()

# %% [markdown]
# ## Receivers
#
# Errors of several receivers on true paths, a stretch of them for each seed. A dot is a cell: the default's
# mean error over the better of the fixes themselves and the Gaussian with the receiver's sigmas. Right of the
# line at 1.05 the default is worse, unless its error is below 0.05 m (hollow dots). The default regions were
# chosen by the receiver of the cells in grey.

# %%
for name in [name for name in FILES if name.startswith("receivers")]:
    receivers = load(name)
    summary = receivers["summary"]
    show([{"": key, **{group: summary[group][key] for group in summary}} for key in summary["all"]])
    labels = [f"{row['recording']}, {row['source']}" for row in receivers["rows"]]
    places = {label: place for place, label in enumerate(dict.fromkeys(labels))}
    figure, axes = plt.subplots(figsize=(8, 0.8 + 0.22 * len(places)), layout="constrained")
    for row, label in zip(receivers["rows"], labels, strict=True):
        if row["ratio"] is not None:
            colour = "#9aa0a6" if row["seen"] else "#c8553d" if row["worse"] else "#2a9d8f"
            inside = colour if row["mean_m"]["cylinder"] >= 0.05 else "white"
            axes.plot(row["ratio"], places[label], "o", color=colour, mfc=inside)
    axes.axvline(1.05, color="k", lw=1)
    axes.set_yticks(range(len(places)), list(places))
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="mean error of the default over the better of fixes and Gaussian")
    ticks = [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    plt.show()

# %% [markdown]
# ## The video alone
#
# Scale of 10 m of the path against the truth, relative to its median: how it drifts without GPS. A line per
# seed, in green with the camera's height above the road; dashed is COLMAP on the same video.

# %%
for name in [name for name in FILES if name.startswith("odometry")]:
    odometry = load(name)
    lists = ("piece_t_s", "piece_scale", "stages_s")
    show([{key: row[key] for key in row if key not in lists} for row in odometry["rows"]])
    names = list(dict.fromkeys(row["recording"] for row in odometry["rows"]))
    size = (4.5 * len(names), 3)
    figure, axes = plt.subplots(1, len(names), figsize=size, squeeze=False, layout="constrained")
    for row in odometry["rows"]:
        style = "k--" if "COLMAP" in row["by"] else "g-" if "height" in row["by"] else "b-"
        axis = axes[0, names.index(row["recording"])]
        axis.plot(row["piece_t_s"], row["piece_scale"], style, lw=1)
        axis.set(xlabel="time [s]", ylabel="scale", title=row["recording"])
    plt.show()

# %% [markdown]
# ## A shaken camera against a landmark database
#
# Table 1 of Matsuda 2007 on the shaken drive, against a database of the drive's even frames; errors of its
# odd frames.

# %%
if "matsuda_table1" in FILES:
    tracker = load("matsuda_table1")
    show(tracker["rows"])
    names = [row["method"] for row in tracker["rows"]]
    figure, (position, held) = plt.subplots(1, 2, figsize=(10, 3), sharey=True, layout="constrained")
    position.barh(names, [row["position_mean_m"] for row in tracker["rows"]], color="#5a6acf")
    position.plot([row["position_max_m"] for row in tracker["rows"]], range(len(names)), "k|", ms=10)
    position.set(xlabel="position error [m]: mean, and tick at the maximum", xscale="log")
    held.barh(names, [100 * row["held"] / row["frames"] for row in tracker["rows"]], color="#2a9d8f")
    held.set(xlabel="frames held [%]", xlim=(0, 100))
    position.invert_yaxis()
    plt.show()

# %% [markdown]
# ## All others

# %%
for name in list(FILES):
    result = load(name)
    if result["summary"]:
        display(Markdown(f"{name}: {text(result['summary'])}"))
    show(result["rows"])
