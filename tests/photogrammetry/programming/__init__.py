"""What `import photogrammetry` offers."""
