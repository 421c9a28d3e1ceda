"""Places seen again: found by appearance, checked by geometry, and tied to what was seen there before."""
