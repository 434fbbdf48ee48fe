"""The commands of `svev`, one module each."""
