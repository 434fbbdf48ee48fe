"""The bundle over time: normal equations, gross errors, errors that last."""
