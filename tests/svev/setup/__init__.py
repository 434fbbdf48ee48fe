"""`svev setup`: questions at a real terminal, cameras over loopback, files that their own readers take."""
