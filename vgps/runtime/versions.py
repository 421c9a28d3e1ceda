"""Versions of what decides the digits of a result."""

import platform
from importlib.metadata import PackageNotFoundError, version

_NAMED = ("vgps", "gtsam", "numpy", "scipy", "opencv-python-headless", "av")


def versions() -> dict[str, str]:
    """Return the versions of Python, of vgps and of the libraries that it computes with."""
    found = {"python": platform.python_version()}
    for name in _NAMED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
