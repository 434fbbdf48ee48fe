"""How a free block is carried onto the surveyed points, and what that says of the survey."""
