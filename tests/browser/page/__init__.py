"""The page itself: states, sizes, languages, accessibility, connection."""
