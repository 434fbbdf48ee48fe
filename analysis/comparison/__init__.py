"""Two measured jumps compared: differences over the time since the take-off, and which of them are real."""
