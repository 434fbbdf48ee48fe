"""How the cameras see it: rendered images, true to a fiftieth of a pixel."""
