"""Measures the logs of a campaign: which ones, whether that is done already, on which processors."""
