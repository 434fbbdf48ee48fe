"""What programs of others use, by names instead of columns; `import photogrammetry` offers it."""
