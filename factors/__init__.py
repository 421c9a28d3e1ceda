"""GTSAM factors for cameras with GPS: usable without vgps, on gtsam and numpy alone."""
