"""Results for people and for other programs: report pages, plain text, result files."""
