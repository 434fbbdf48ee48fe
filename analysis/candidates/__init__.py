"""What may be a marker or a ski in single images."""
