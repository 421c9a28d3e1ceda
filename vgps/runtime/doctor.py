"""What this installation has and lacks: versions, codecs, cores, memory."""

import importlib
import os
import platform
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version

from packaging.requirements import Requirement

CODECS = ("h264", "hevc", "av1", "vp9", "mpeg4", "mjpeg", "prores")
_FOR_DEVELOPERS = {"test", "bench"}  # extras
# packages whose wheels hold compiled code that may not suit the machine, and the names they are imported by
_COMPILED = {
    "numpy": "numpy",
    "scipy": "scipy",
    "gtsam": "gtsam",
    "opencv-python-headless": "cv2",
    "av": "av",
}


@dataclass(frozen=True)
class Finding:
    """One line of the report: what, how it is, and what to do if it is wrong ("" if it is not)."""

    name: str
    state: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Return what vgps needs and how it is here; a finding with a remedy keeps some verb from working."""
    return [*_machine(), *_packages(), *_codecs(), *_viewer()]


def _machine() -> Iterator[Finding]:
    python = platform.python_version()
    supported = sys.version_info >= (3, 11) and sys.implementation.name == "cpython"
    yield Finding("Python", python, "" if supported else "install CPython 3.11 or later")
    yield Finding("system", f"{platform.system()} {platform.release()}, {platform.machine()}")
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    yield Finding("cores", f"{usable} of {os.cpu_count()}")
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        memory_gb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30
        yield Finding("memory", f"{memory_gb:.1f} GB")


def _packages() -> Iterator[Finding]:
    yield Finding("vgps", version("vgps"))
    for text in requires("vgps") or ():
        requirement = Requirement(text)
        extra = _extra(requirement)
        if extra not in _FOR_DEVELOPERS and extra is not None:
            yield _package(requirement, extra)


def _extra(requirement: Requirement) -> str | None:
    """Return the extra that asks for a package, "" if vgps itself does, None if none does on this system."""
    marker = requirement.marker
    if marker is None or marker.evaluate({"extra": ""}):
        return ""
    extras = metadata("vgps").get_all("Provides-Extra") or ()
    return next((extra for extra in extras if marker.evaluate({"extra": extra})), None)


def _package(requirement: Requirement, extra: str) -> Finding:
    name = requirement.name
    try:
        found = version(name)
    except PackageNotFoundError:
        remedy = f'pip install "vgps[{extra}]"' if extra else f'pip install "{name}"'
        return Finding(
            name, f"not installed ({remedy})" if extra else "not installed", "" if extra else remedy
        )
    if not requirement.specifier.contains(found, prereleases=True):
        wanted = f"{name}{requirement.specifier}"
        return Finding(name, f"{found}, expected {requirement.specifier}", f'pip install "{wanted}"')
    broken = "" if extra else _broken(name)
    return Finding(
        name, f"{found}, cannot be imported: {broken}" if broken else found, _reinstall(name, broken)
    )


def _broken(name: str) -> str:
    """Return why a package with compiled code cannot be imported; "" if it can, or has none."""
    if name not in _COMPILED:
        return ""
    try:
        importlib.import_module(_COMPILED[name])
    except ImportError as error:
        return " ".join(str(error).split())
    return ""


def _reinstall(name: str, broken: str) -> str:
    return f"pip install --force-reinstall {name}" if broken else ""


def _codecs() -> Iterator[Finding]:
    try:
        av = importlib.import_module("av")
    except ImportError:
        return  # reported among the packages
    known = set(av.codecs_available)
    missing = [codec for codec in CODECS if codec not in known]
    state = f"decodes {', '.join(codec for codec in CODECS if codec in known)}"
    remedy = f"install a PyAV with {', '.join(missing)}, or convert such videos" if missing else ""
    yield Finding("FFmpeg", state, remedy)


def _viewer() -> Iterator[Finding]:
    if sys.platform == "linux":
        shown = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
        without = "none: vgps inspect needs --save or --screenshot"
        yield Finding("display", "available" if shown else without)
