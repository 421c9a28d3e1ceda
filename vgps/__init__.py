"""The pose of every frame of a video in world coordinates, from the video and a GPS log."""
