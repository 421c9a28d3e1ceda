"""Experiments of Matsuda 2007: Table 1 on a recording, and the rates at which the tracker fails."""
