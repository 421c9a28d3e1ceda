"""Importing this keeps compiled modules from run to run, whatever the environment says.

With ``PYTHONDONTWRITEBYTECODE``, as in many container images, each process of each run would compile vgps and
rewrite the assertions of all tests again: half of what it takes to collect them. To be imported first.
"""

import os
import sys

sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # for the workers, and for commands that tests run
