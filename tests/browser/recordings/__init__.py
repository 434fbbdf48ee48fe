"""Recordings on the page."""
