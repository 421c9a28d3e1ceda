"""Scale, heading and place of a map: by its fixes, the land under it, or an IMU."""
