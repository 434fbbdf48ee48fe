"""Copies recordings to another disk behind the recording, and releases those that are safe there."""
