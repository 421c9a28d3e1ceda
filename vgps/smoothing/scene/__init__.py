"""The scene as one bundle problem: factors of frames, features, ground, rigs and loops."""
