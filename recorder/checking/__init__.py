"""Checks a log from the first to the last byte."""
