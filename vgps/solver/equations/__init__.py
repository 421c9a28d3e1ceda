"""Normal equations of a bundle problem, chunk by chunk, and the elimination of its landmarks."""
