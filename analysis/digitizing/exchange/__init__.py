"""Marks in files: a table for spreadsheets, and folders of other digitizers."""
