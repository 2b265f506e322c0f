"""Lab 1, Pixels to landmark: from a picture to an outline."""
