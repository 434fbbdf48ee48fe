"""Benchmarks of the trigger: pairing against clocks and rates that nobody told it of."""
