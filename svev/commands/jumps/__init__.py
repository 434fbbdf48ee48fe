"""Commands that measure jumps."""
