"""Table 6 of Kume 2010: methods A to D, the cylinder and Cauchy, on simulated walks or a recording."""
