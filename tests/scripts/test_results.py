"""Result files say where their rows come from, and the documents quote them faithfully."""

import re
import subprocess
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from scripts.common import results
from scripts.common.results import CODE, Results, read_results
from vgps.errors import RunFolderError

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted((ROOT / "notebooks" / "results").glob("*.json"))
DOCUMENTS = [
    ROOT / "README.md",
    *(file for room in ("vgps", "factors", "scripts") for file in (ROOT / room).rglob("*.md")),
]


def test_rows_are_written_as_they_come(tmp_path):
    file = tmp_path / "deeper" / "found.json"
    written = Results(file, "How long?")
    written.add(log="gps_fix", count=np.int64(3), mean_m=np.float64(1 / 3), worst_m=np.nan)
    assert len(read_results(file)["rows"]) == 1
    written.add(ok=np.True_, parts_ms={"graph": 2.0}, of=[1, 2.5])
    written.summarise(frames=801)
    found = read_results(file)
    assert found["rows"] == [
        {"log": "gps_fix", "count": 3, "mean_m": 0.333333, "worst_m": None},
        {"ok": True, "parts_ms": {"graph": 2.0}, "of": [1, 2.5]},
    ]
    assert found["question"] == "How long?" and found["summary"] == {"frames": 801}


def test_nothing_is_written_without_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written = Results(None, "How long?")
    written.add(mean_m=1.0)
    written.summarise(frames=1)
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    with pytest.raises(RunFolderError):
        Results(tmp_path, "How long?")


def test_changed_code_is_dirty_and_changed_documents_are_not(tmp_path, monkeypatch):
    monkeypatch.setattr(results, "ROOT", tmp_path)

    def git(*words):
        identity = ("-c", "user.name=a", "-c", "user.email=a@b")
        subprocess.run(["git", *identity, *words], cwd=tmp_path, check=True, capture_output=True)

    assert results.provenance()["commit"] == "unknown"
    git("init")
    for room in CODE:
        (tmp_path / room).mkdir()
        (tmp_path / room / "a.py").write_text("1\n")
    git("add", ".")
    git("commit", "-m", "begin")
    (tmp_path / "README.md").write_text("changed\n")
    clean = results.provenance()
    assert not clean["dirty"] and re.fullmatch("[0-9a-f]{40}", clean["commit"])
    (tmp_path / "vgps" / "a.py").write_text("2\n")
    assert results.provenance()["dirty"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_result_names_command_commit_machine_and_date(file):
    found = read_results(file)
    assert found["schema_version"] == results.SCHEMA_VERSION and "?" in found["question"]
    assert re.match(r"python -m scripts\.\w+\.\w+", found["command"])
    assert f"--json notebooks/results/{file.name}" in found["command"]
    assert re.fullmatch("[0-9a-f]{40}", found["commit"]) and not found["dirty"]
    assert {"cpu", "cores", "load", "python", "blas"} <= set(found["machine"])
    assert datetime.fromisoformat(found["date"]).utcoffset() is not None
    assert found["rows"] and not any("commit" in row for row in found["rows"])
    assert not re.search(r"(?<![\w.])/\w+/", file.read_text(encoding="utf-8"))  # no folder of a machine


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_result_is_of_a_commit_of_this_history(file):
    def git(*words):
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)

    if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        pytest.skip("needs the history of a full clone")
    assert git("merge-base", "--is-ancestor", read_results(file)["commit"], "HEAD").returncode == 0


def tables(text: str):
    """Yield every table of a document with the paragraph before it."""
    paragraph = ""
    for block in re.split(r"\n\s*\n", text):
        if block.lstrip().startswith("|"):
            yield paragraph, block
        paragraph = block


def quoted(paragraph: str) -> set[str]:
    """Return the names of the result files to which a paragraph links."""
    return set(re.findall(r"results/(\w+)\.json", paragraph))


def numbers(value) -> list[float]:
    """Return every number in a JSON value."""
    if isinstance(value, dict | list):
        parts = value.values() if isinstance(value, dict) else value
        return [number for part in parts for number in numbers(part)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []


QUOTING = [
    (file, paragraph, table)
    for file in DOCUMENTS
    for paragraph, table in tables(file.read_text(encoding="utf-8"))
    if quoted(paragraph)
]


@pytest.mark.parametrize(("file", "paragraph", "table"), QUOTING)
def test_a_table_quotes_one_result_and_quotes_it_faithfully(file, paragraph, table):
    (name,) = quoted(paragraph)
    found = read_results(ROOT / "notebooks" / "results" / f"{name}.json")
    measured = np.array(numbers(found["rows"]) + numbers(found["summary"]))
    for line in table.splitlines()[2:]:
        for cell in line.split("|")[2:-1]:
            for word in re.findall(r"(?<![\d.])-?\d+\.\d+", cell):
                digits = len(word.partition(".")[2])
                assert np.isclose(np.round(measured, digits), float(word), atol=1e-9).any(), (cell, name)


def test_some_table_quotes_a_result():
    assert QUOTING


def test_the_check_of_tables_finds_them():
    text = "Errors ([all](notebooks/results/a.json)):\n\n| log | m |\n|---|---|\n| x | 0.5 |\n\nend\n"
    assert [(quoted(before), table.count("|")) for before, table in tables(text)] == [({"a"}, 9)]
    assert numbers({"a": [1, 2.5, None, True], "b": "3"}) == [1, 2.5]
