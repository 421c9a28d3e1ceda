"""What several scripts share: command line, results files, tables, scenes, COLMAP."""
