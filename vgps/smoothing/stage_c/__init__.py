"""Stage C, Kume 2010: the last frames optimised, by Gauss-Newton steps or by iSAM2."""
