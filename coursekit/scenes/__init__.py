"""What the labs' explorers draw, one module a lab: scenes that build their figure once and then move its artists."""
