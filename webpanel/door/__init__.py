"""Who gets in: names and origins, token and logins, size limits, number of open streams."""
