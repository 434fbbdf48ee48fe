"""Reports for people: the coach's page, the geodesist's protocol, and the video with overlay."""
