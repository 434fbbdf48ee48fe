"""One camera in the pairing: its connection, its frame times, its gaps and its signs of life."""
