"""Skis as bars in space: both skis of a pulse fitted at once to the grey values of all cameras that show them."""
