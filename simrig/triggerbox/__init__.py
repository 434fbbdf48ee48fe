"""An emulated trigger box (strawlab, protocol 14) behind a pseudo-terminal, with the faults that real ones have."""
