"""Lab 0, The world: how a robot moves, and how sure it can be of that."""
