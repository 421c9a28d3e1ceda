"""Stage C's window beside iSAM2 and its fixed-lag smoother."""
