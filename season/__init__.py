"""A season: many logs measured on many machines, and what they say together."""
