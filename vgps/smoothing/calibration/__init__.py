"""What the observations say of a camera: its lens, its readout, its place on a rig."""
