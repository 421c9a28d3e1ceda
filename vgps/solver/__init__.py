"""The sparse engine: a bundle problem, its normal equations, elimination, and Levenberg-Marquardt."""
