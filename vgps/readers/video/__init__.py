"""Frames with their times, from video files and folders of images, and what else those files hold."""
