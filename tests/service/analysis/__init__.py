"""Jumps that are measured while they are recorded."""
