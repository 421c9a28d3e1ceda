"""The command line's root: verbs hang themselves on it."""

from cyclopts import App

app = App(name="vgps", help="The pose of every frame of a video in world coordinates, from video and GPS.")
