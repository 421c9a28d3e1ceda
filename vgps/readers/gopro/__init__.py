"""GoPro's metadata: GPS, inertial sensors, lens and stabilisation, and recordings in chapters."""
