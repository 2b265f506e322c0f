"""Lab 6, Iterative closest point: two clouds, one motion."""
