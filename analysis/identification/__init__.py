"""Identification: which candidate in which image is which marker, which ski, by geometry in all cameras at once."""
