"""What is in front of the static scene."""
