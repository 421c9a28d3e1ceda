"""The notebooks run from top to bottom."""

import ast
import importlib
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
# what a reader sees takes long; less of it runs the same code
SMALLER = {
    "fast_rotation": {
        "SURVEY_S, FAST_S = 4.0, 2.0": "SURVEY_S, FAST_S = 1.2, 0.6",
        "texture_scale=0.5": "texture_scale=0.25, max_samples=8",
    },
    "penalty": {"EXPONENTS = (1, 2, 4, 8, 16)": "EXPONENTS = (1, 2)"},
    "survey": {"linspace(0, 0.3, 61)": "linspace(0, 0.3, 7)", "18_000, 8": "1800, 8"},
    # methods B and C share their front end
    "table6": {
        "WALK_S = 12.0": "WALK_S = 2.0",
        "fps=10": "fps=6, max_samples=8",
        "NoProgress(), METHODS": "NoProgress(), METHODS[1:3]",
    },
}
RESOURCES = {"metadata": {"path": str(ROOT / "notebooks")}}
# what another notebook left in the kernel: its names, and the way to scripts/, which is no installed package
FORGET = """# %%
%reset -f
import sys
sys.path[:] = [folder for folder in sys.path if folder != ".."]
for module in [name for name in sys.modules if name.split(".")[0] == "scripts"]:
    del sys.modules[module]
del sys

"""


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


@pytest.fixture(scope="module")
def client() -> Iterator["NotebookClient"]:
    """Return the client of one kernel, where what several notebooks import is imported once."""
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("matplotlib_inline")
    made = nbclient.NotebookClient(None, timeout=600, kernel_name="python3", resources=RESOURCES)
    data = os.environ.get("VGPS_DATA", str(ROOT.parent / "shared" / "data"))
    # BLAS's threads as in tests/conftest.py
    with made.setup_kernel(env=os.environ | {"VGPS_DATA": data, "OPENBLAS_NUM_THREADS": "1"}):
        yield made


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_something(path: Path, client: "NotebookClient") -> None:
    """It runs as from a clean checkout, in its own folder, where it leaves nothing behind."""
    jupytext = pytest.importorskip("jupytext")
    client.nb = notebook = jupytext.reads(FORGET + smaller(path), fmt="py:percent")
    before = set(path.parent.rglob("*"))
    client.execute(cleanup_kc=False)
    assert {file for file in path.parent.rglob("*") if "__pycache__" not in file.parts} <= before
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    shown = [output for cell in code for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert not any(output.output_type == "error" for output in shown)
