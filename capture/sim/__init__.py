"""Cameras inside the process, for tests and demonstrations."""
