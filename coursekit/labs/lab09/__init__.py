"""Lab 9, Reality: a filter over a real recording."""
