"""Pairing: which frame belongs to which pulse, and what became of every pulse in every camera."""
