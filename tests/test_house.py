"""The rooms are kept: who may import what, and both packages are this project's own."""

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import factors
import vgps

ROOT = Path(__file__).resolve().parents[1]
MATCHING = {
    "BFMatcher",
    "DISOpticalFlow",
    "DISOpticalFlow_create",
    "DescriptorMatcher",
    "DescriptorMatcher_create",
    "FlannBasedMatcher",
    "buildOpticalFlowPyramid",
    "calcOpticalFlowFarneback",
    "calcOpticalFlowPyrLK",
    "computeECC",
    "findTransformECC",
    "matchTemplate",
    "phaseCorrelate",
}


def imported(source: str) -> Iterator[str]:
    """Yield the dotted names that a file imports or uses: ``cv2``, ``cv2.matchTemplate``."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{name.name}" for name in node.names)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield f"{node.value.id}.{node.attr}"


@cache
def source_of(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@cache
def imported_by(file: Path) -> frozenset[str]:
    return frozenset(imported(source_of(file)))


def rooms_that_use(*names: str) -> set[str]:
    """Return the rooms (``vgps.geodesy``, ``factors``) that use one of the dotted names."""
    found = set()
    roots = {name.split(".")[0] for name in names}  # what does not stand in a file need not be parsed for
    for package in (vgps, factors):
        home = Path(next(iter(package.__path__)))
        for file in home.rglob("*.py"):
            used = imported_by(file) if any(root in source_of(file) for root in roots) else ()
            if any(one == name or one.startswith(f"{name}.") for one in used for name in names):
                room = file.relative_to(home).parts[0].removesuffix(".py")
                found.add("factors" if package is factors else f"vgps.{room}")
    return found


def test_both_packages_come_from_one_place() -> None:
    # PyPI has an unrelated project named factors
    assert vgps.__file__ is not None and factors.__file__ is not None
    assert Path(vgps.__file__).parents[1] == Path(factors.__file__).parents[1]


def test_version_is_that_of_the_installed_package() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert vgps.__version__ == declared


@pytest.mark.slow
def test_imports_go_down() -> None:
    # in a separate process: import-linter disables loggers that other tests capture
    code = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_cache=True))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_tests_mirror_the_rooms() -> None:
    rooms = {path.parent.name for path in Path(next(iter(vgps.__path__))).glob("*/__init__.py")}
    tested = {path.parent.name for path in (ROOT / "tests").glob("*/test_*.py")}
    assert tested <= rooms | {"factors", "scripts"}, "tests of a room that is gone"
    assert rooms <= tested, "a room without tests"


def test_only_geodesy_imports_pymap3d() -> None:
    assert rooms_that_use("pymap3d") == {"vgps.geodesy"}


def test_only_crs_imports_pyproj() -> None:
    assert rooms_that_use("pyproj") == {"vgps.crs"}


@pytest.mark.slow
def test_only_tracking_localization_and_places_match_images() -> None:
    matching = {"vgps.tracking", "vgps.localization", "vgps.places"}
    assert rooms_that_use(*(f"cv2.{name}" for name in MATCHING)) == matching


def test_only_the_viewer_imports_rerun() -> None:
    assert rooms_that_use("rerun") <= {"vgps.viewer"}


def test_factors_import_only_gtsam_and_numpy() -> None:
    home = Path(next(iter(factors.__path__)))
    sources = [file.read_text(encoding="utf-8") for file in home.rglob("*.py")]
    trees = [node for source in sources for node in ast.walk(ast.parse(source))]
    roots = {name.name.split(".")[0] for node in trees if isinstance(node, ast.Import) for name in node.names}
    roots |= {str(node.module).split(".")[0] for node in trees if isinstance(node, ast.ImportFrom)}
    assert roots - sys.stdlib_module_names == {"factors", "gtsam", "numpy"}


def test_imports_inside_functions_count() -> None:
    source = "import a.b\ndef f():\n    from c import d\n    import cv2\n    return cv2.matchTemplate\n"
    assert set(imported(source)) == {"a.b", "c.d", "cv2", "cv2.matchTemplate"}
