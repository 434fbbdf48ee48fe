"""Reads logs, also damaged and growing ones."""
