"""Points, followed by their appearance."""
