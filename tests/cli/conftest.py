"""The run that the verbs' tests examine."""

import sys
from pathlib import Path

import pytest
from shared_runs import SharedFolder

from vgps.cli import main


@pytest.fixture(scope="session")
def smoothed(recording: Path, shared_folder: SharedFolder) -> Path:
    """The run folder of the small recording, made by the command."""

    def command(out: Path) -> None:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(sys, "argv", ["vgps", "smooth", str(recording), "--out", str(out)])
            with pytest.raises(SystemExit) as ended:
                main()
        assert not ended.value.code

    return shared_folder("run", command)
