"""Measures the jumper from published triplets, live or from a replayed log."""
