"""A program that writes an output until its standard input ends."""

HOLDER = """
import sys
from pathlib import Path
from vgps.writers.claim import claimed
with claimed(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""
