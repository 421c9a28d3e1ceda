"""Maps and cameras of a rig merged into one scene."""
