"""What follows from marks in space, while they are made."""
