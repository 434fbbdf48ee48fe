"""Tests of measuring by hand."""
