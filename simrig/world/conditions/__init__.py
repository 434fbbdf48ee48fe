"""What makes images harder to measure: light, surroundings, cameras that move; and the tables of a scenario for it."""
