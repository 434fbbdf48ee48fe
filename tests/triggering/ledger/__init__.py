"""What became of every pulse."""
