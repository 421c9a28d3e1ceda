"""The tracker of Matsuda 2007: the pose of a camera against a landmark database."""
