"""Writers: run folders, and their export to the files of other programs."""
