"""Lab 7, The particle filter: many guesses, weighed."""
