"""The notebooks run from top to bottom."""

import ast
import importlib
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
# what a reader sees takes long; less of it runs the same code
SMALLER = {
    "fast_rotation": {"SURVEY_S, FAST_S = 4.0, 2.0": "SURVEY_S, FAST_S = 1.6, 0.8"},
    "penalty": {"EXPONENTS = (1, 2, 4, 8, 16)": "EXPONENTS = (1, 2)"},
    "table6": {"WALK_S = 12.0": "WALK_S = 5.0"},
}


def test_there_are_notebooks() -> None:
    names = ["fast_rotation", "penalty", "results", "survey", "table6"]
    assert [path.stem for path in NOTEBOOKS] == names


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_cell_draws_one_result_at_most(path: Path) -> None:
    for cell in path.read_text(encoding="utf-8").split("\n# %%"):
        assert len(re.findall(r"\bload\(\"|read_results\(Path", cell)) <= 1


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_names_that_a_notebook_imports_exist(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.module is not None and node.module.split(".")[0] in {"vgps", "factors", "scripts"}:
            found = importlib.import_module(node.module)
            assert all(hasattr(found, name.name) for name in node.names), ast.unparse(node)


def smaller(path: Path) -> str:
    """Return the notebook with less to compute."""
    text = path.read_text(encoding="utf-8")
    for whole, part in SMALLER.get(path.stem, {}).items():
        assert text.count(whole) == 1
        text = text.replace(whole, part)
    return text


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_something(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs as from a clean checkout, in its own folder, where it leaves nothing behind."""
    jupytext = pytest.importorskip("jupytext")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("matplotlib_inline")
    monkeypatch.setenv("VGPS_DATA", os.environ.get("VGPS_DATA", str(ROOT.parent / "shared" / "data")))
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # as in tests/conftest.py
    notebook = jupytext.reads(smaller(path), fmt="py:percent")
    resources = {"metadata": {"path": str(path.parent)}}
    before = set(path.parent.rglob("*"))
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    assert {file for file in path.parent.rglob("*") if "__pycache__" not in file.parts} <= before
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    shown = [output for cell in code for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert not any(output.output_type == "error" for output in shown)
