"""The photogrammetric network: its data, its file, parts of it, and why it cannot be solved."""
