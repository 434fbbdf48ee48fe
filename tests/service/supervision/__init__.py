"""The supervisor without processes."""
