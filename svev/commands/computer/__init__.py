"""Commands that set up and examine a computer."""
