"""``python -m vgps`` is ``vgps``."""

from vgps.cli import main

main()
