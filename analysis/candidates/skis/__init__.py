"""Long straight bars in single images that may be skis."""
