"""What the service says of itself: status, statements, metrics, live log."""
