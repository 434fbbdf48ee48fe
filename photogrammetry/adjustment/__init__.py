"""The bundle adjustment (paper, appendix D) of any network, with covariance and tests; `run.adjust` is its entry."""
