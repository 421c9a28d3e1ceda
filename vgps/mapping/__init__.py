"""The local map that stages A to C share, and what of it is kept."""
