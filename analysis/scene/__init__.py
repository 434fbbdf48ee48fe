"""The scene that does not move: static images, balls, their names, and the orientation of the cameras from them."""
