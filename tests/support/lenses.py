"""Lenses that several tests look through."""

from vgps.model import Camera

# 1/3 inch sensor of 720 x 480 pixels behind a wide converter, as in the thesis
TSAI = Camera(
    model="tsai",
    width=720,
    height=480,
    fx=600.0,
    fy=590.0,
    cx=355.0,
    cy=238.0,
    distortion=(8e-3, 1e-4),
    pixel_mm=(4.8 / 720 / 1.02, 3.6 / 480),
)
