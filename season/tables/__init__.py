"""One table of all jumps, pulses and cameras of a season, and questions to it."""
