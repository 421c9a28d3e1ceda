"""What ships vgps elsewhere says the same as pyproject.toml."""

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base"}


def test_the_conda_recipe_has_the_same_version_and_requirements():
    recipe = yaml.safe_load((ROOT / ".conda/recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == PROJECT["version"]
    assert f">={recipe['context']['python_min']}" == PROJECT["requires-python"]
    expected = {"python >=${{ python_min }}"}
    for requirement in PROJECT["dependencies"]:
        name, version = re.fullmatch(r"([A-Za-z0-9-]+)(.*)", requirement).groups()
        expected.add(f"{CONDA_NAMES.get(name, name)} {version}")
    assert set(recipe["requirements"]["run"]) == expected


def test_the_container_runs_without_rights_and_installs_the_lock():
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    assert "USER vgps" in lines and lines.index("USER vgps") > max(
        number for number, line in enumerate(lines) if line.startswith("FROM")
    )
    assert sum("uv sync --locked" in line for line in lines) == 2
    copied = {
        name
        for line in lines
        if line.startswith("COPY") and "--from" not in line
        for name in line.split()[1:-1]
    }
    allowed = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert copied == allowed
