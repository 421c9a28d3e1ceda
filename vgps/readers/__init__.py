"""A file in, a piece of a recording out; formats are told by content, not by suffix alone."""
