"""The IMU in the factor graph: samples at the camera, preintegration, velocities and biases."""
