"""From triplets to the jumper: what the images of a recording show."""
