"""Spots and discs in single images that may be markers."""
