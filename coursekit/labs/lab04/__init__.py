"""Lab 4, The extended Kalman filter: where am I, with a map."""
