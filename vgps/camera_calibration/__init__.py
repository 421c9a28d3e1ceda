"""A camera found from its own video: a guess, the epipolar geometry of many pairs of views, then stage D."""
