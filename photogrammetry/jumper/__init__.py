"""The jumper in numbers."""
