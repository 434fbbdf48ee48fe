"""The least-squares solution of a network: normal equations, iteration, datum, rank, covariance and test values."""
