"""Exports that the service makes for the page, one after the other, each in a process of its own."""
