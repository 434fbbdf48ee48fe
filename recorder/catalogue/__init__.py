"""The recordings of a folder: list, session fields, trash."""
