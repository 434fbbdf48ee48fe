"""What was measured in the images of the jumper: the model, and the file `measurements.json`."""
