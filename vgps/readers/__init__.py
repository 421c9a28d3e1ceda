"""Readers: from files to the parts of a recording; the content tells the format, not the suffix."""
