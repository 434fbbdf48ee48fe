"""The panel's page in a real browser, and its sources."""
