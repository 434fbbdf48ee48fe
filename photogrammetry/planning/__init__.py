"""Predicts how accurate a network will be before it is built: by covariance and by Monte Carlo."""
