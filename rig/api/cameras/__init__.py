"""A camera that is being set up, in the form of the REST API: sharpness, exposure, where the balls should be."""
