"""Recordings, from arming to what the log holds."""
