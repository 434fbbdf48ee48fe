"""GigE Vision cameras outside of a recording: the present ones, their features, their addresses."""
