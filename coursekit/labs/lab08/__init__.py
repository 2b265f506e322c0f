"""Lab 8, A visual particle filter: a camera above the sea floor."""
