"""Lab 3, A noise model: what a measurement says about the truth."""
