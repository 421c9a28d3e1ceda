"""Every script explains itself, has --json if it measures, is listed in the README, and stands alone."""

import ast
import importlib
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "scripts"
ROOMS = ("benchmarks", "examples", "experiments", "tools")


def is_script(file: Path) -> bool:
    return 'if __name__ == "__main__":' in file.read_text(encoding="utf-8")


FILES = sorted(file for room in ROOMS for file in (FOLDER / room).rglob("*.py") if is_script(file))


def module_name(file: Path) -> str:
    """Return what stands behind ``python -m``."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")


NAMES = [module_name(file) for file in FILES]


def load(file: Path):
    """Import a script, or skip where it needs a program that is not installed."""
    if "pycolmap" in file.read_text(encoding="utf-8"):
        pytest.importorskip("pycolmap")
    return importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=NAMES)
def test_help_says_what_a_script_is_for(file, monkeypatch, capsys):
    module = load(file)
    monkeypatch.setattr(sys, "argv", [str(file), "--help"])
    with pytest.raises(SystemExit) as stop:
        module.main()
    text = capsys.readouterr().out
    assert stop.value.code == 0
    assert text.startswith(f"usage: python -m {module_name(file)} ")
    assert " ".join(module.__doc__.splitlines()[0].split()) in " ".join(text.split())
    assert ("--json FILE" in text) == (file.relative_to(FOLDER).parts[0] in ("benchmarks", "experiments"))


STRICT = [file for file in FILES if file.parent.name != "examples"]


@pytest.mark.parametrize("file", STRICT, ids=map(module_name, STRICT))
def test_an_unknown_option_is_refused_in_one_line(file, monkeypatch, capsys):
    module = load(file)
    monkeypatch.setattr(sys, "argv", [str(file), "--no-such-option"])
    with pytest.raises(SystemExit) as stop:
        module.main()
    out, err = capsys.readouterr()
    assert stop.value.code == 2 and out == "" and err.count("\n") == 1


def imported(file: Path) -> set[str]:
    """Return the modules below ``scripts`` that a file imports."""
    nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
    names = {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
    return {name for name in names if name.split(".")[0] == "scripts"}


@pytest.mark.parametrize("file", sorted(FOLDER.rglob("*.py")), ids=lambda file: str(file.relative_to(FOLDER)))
def test_no_script_imports_another(file):
    """It may import ``scripts.common`` and, as a module of a package, its package's other modules."""
    rooms = {f"scripts.{room}" for room in ROOMS}
    package = ".".join(file.parent.relative_to(ROOT).parts)
    shared = ("scripts.common.",) if package in rooms else ("scripts.common.", f"{package}.")
    assert {name for name in imported(file) if not name.startswith(shared)} == set()
    assert not imported(file) & set(NAMES)


def test_the_readme_lists_every_script_once():
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    rooms = "|".join(ROOMS)
    listed = re.findall(rf"^\| .*? \| `((?:{rooms})\.\S+?)[ `]", text, flags=re.MULTILINE)
    assert sorted(f"scripts.{name}" for name in listed) == sorted(NAMES)
