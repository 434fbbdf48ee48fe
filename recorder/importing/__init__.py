"""Makes logs of films: image sequences and videos of other cameras."""
