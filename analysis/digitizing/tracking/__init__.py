"""Places in images to a part of a pixel: refined where somebody clicked, and carried on through the pulses."""
