"""Pictures wider than a plane can hold, seen through several pinhole views."""
