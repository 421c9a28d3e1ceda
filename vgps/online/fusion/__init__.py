"""The path of the video fitted to the fixes of the last minutes, with the offsets of their errors."""
