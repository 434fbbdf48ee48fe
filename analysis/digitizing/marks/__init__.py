"""What operators said of the images, kept."""
