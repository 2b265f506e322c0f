"""Lab 5, EKF-SLAM: where am I, without a map."""
