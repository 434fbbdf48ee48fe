"""Protocols of adjustments, as text and as one self-contained HTML page."""
