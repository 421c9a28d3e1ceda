"""Make ``scripts`` importable: it is no part of the wheel."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2]))
