"""What there is to see: drawn from back to front into an image of radiance."""
