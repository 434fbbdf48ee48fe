"""Publishes triplets over ZeroMQ, live and from a log."""
