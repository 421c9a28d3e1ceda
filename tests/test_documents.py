"""The documents are true: names exist, links lead somewhere, README and CI give the same test command."""

import ast
import importlib
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

import vgps
from vgps.cli.app import app

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = [
    *ROOT.glob("*.md"),
    *(file for room in ("vgps", "factors", "scripts") for file in (ROOT / room).rglob("README.md")),
]


def exists(path: Path) -> bool:
    """Return whether a file of the project exists; its packages may be those that the wheel installed."""
    inside = Path(os.path.normpath(path)).relative_to(ROOT)
    home = Path(next(iter(vgps.__path__))).parent if inside.parts[0] in {"vgps", "factors"} else ROOT
    return (home / inside).exists()


def blocks(text: str, language: str) -> list[str]:
    """Return the fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


def test_readme_fits_its_length() -> None:
    assert len(README.splitlines()) <= 150


def test_readme_and_ci_give_the_same_test_command() -> None:
    last = (ROOT / ".ci/run").read_text(encoding="utf-8").splitlines()[-1]
    (tested,) = (line for block in blocks(README, "sh") for line in block.splitlines() if "pytest" in line)
    assert tested.endswith(f"&& .venv/bin/{last}")


def test_readme_lists_every_verb() -> None:
    listed = set(re.findall(r"`vgps ([a-z][a-z-]*)", README.split("## Verbs")[1].split("\n## ")[0]))
    assert listed == {name for name in app if not name.startswith("-")}


def test_readme_quotes_the_measured_accuracy() -> None:
    measured = json.loads((ROOT / "notebooks/results/accuracy.json").read_text(encoding="utf-8"))
    logs: dict[str, list[dict]] = {}
    for row in measured["rows"]:
        logs.setdefault(row["log"], []).append(row)
    cells = [
        (
            *(log, f"{np.median([row['mean_m'] for row in rows]):.3f}"),
            *(f"{max(row['mean_m'] for row in rows):.3f}", f"{max(row['max_m'] for row in rows):.2f}"),
            *{str(row["rejected"]) for row in rows},
        )
        for log, rows in logs.items()
    ]
    row = r"^\| `(gps_\w+)`[^|]*\| (\S+) \| (\S+) \| (\S+) \| (\d+) \|$"
    assert re.findall(row, README, re.MULTILINE) == cells
    assert len(cells) == 5 and {len(rows) for rows in logs.values()} == {5} and not measured["dirty"]


def test_places_quote_the_measured_loops() -> None:
    measured = json.loads((ROOT / "notebooks/results/loops.json").read_text(encoding="utf-8"))
    rows = [(alone, tied) for alone, tied in zip(measured["rows"][::2], measured["rows"][1::2], strict=True)]
    cells = [
        (
            *(tied["recording"], f"{tied['frames']:,}", f"{alone['mean_m']:.3f}", f"{tied['mean_m']:.3f}"),
            *(str(tied["ties"]), f"{tied['largest_misfit_px']:.1f}"),
        )
        for alone, tied in rows
    ]
    text = (ROOT / "vgps/places/README.md").read_text(encoding="utf-8")
    row = r"^\| `(\w+)`, (\S+) frames \| (\S+) \| (\S+) \| (\d+) \| (\S+) \|$"
    assert re.findall(row, text, re.MULTILINE) == cells
    seconds = [f"{one['batch_s']:.0f} s" for one in rows[-1][::-1]]
    assert f"it took {' instead of '.join(seconds)}" in text


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_names_in_code_blocks_exist(document: Path) -> None:
    for block in blocks(document.read_text(encoding="utf-8"), "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and node.module:
                module = importlib.import_module(node.module)
                assert all(hasattr(module, name.name) for name in node.names), ast.unparse(node)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_links_and_named_modules_exist(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)[^)]*\)", text) if "://" not in link]
    assert [link for link in links if not exists(document.parent / link)] == []
    modules = re.findall(r"`([\w/]+\.py)`", text)
    homes = (document.parent, ROOT / "vgps", ROOT)
    assert [name for name in modules if not any(exists(home / name) for home in homes)] == []
