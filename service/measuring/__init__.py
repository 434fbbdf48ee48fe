"""Measures the log of every recording after its end, beside the service."""
