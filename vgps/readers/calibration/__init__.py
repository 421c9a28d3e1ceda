"""Cameras and rigs: ``camera.yaml``, ``rig.yaml``, other programs' calibrations, and a guess without one."""
