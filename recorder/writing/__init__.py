"""Writes logs."""
