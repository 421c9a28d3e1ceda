"""Readers: from files to the parts of a recording; formats are recognised by content, not by suffix."""
