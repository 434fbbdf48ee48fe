"""The format of a log: layout of its bytes, schemas and channels, and the memory that is laid out like it."""
