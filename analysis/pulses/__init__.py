"""The jumper in each pulse alone: points and skis by intersection, angles, height and speed, and tests of all rays."""
