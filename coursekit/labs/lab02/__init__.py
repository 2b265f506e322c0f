"""Lab 2, Range and bearing: from an outline to a place."""
