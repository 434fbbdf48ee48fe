"""Start values from nothing: relative orientation, DLT, resection, propagation (paper, steps 1A, 1B, 2A)."""
