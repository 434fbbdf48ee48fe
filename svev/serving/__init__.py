"""`svev serve`: supervisor, web server, signals and systemd in one process."""
