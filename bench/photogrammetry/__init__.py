"""What adjustment, intersection and planning cost, beside scipy."""
