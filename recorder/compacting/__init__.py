"""Makes smaller logs for the archive."""
