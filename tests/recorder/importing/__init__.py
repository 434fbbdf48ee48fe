"""Tests of `svev import`."""
