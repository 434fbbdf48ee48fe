"""Triplet assembly, MCAP log, ZeroMQ publication, verification and replay."""
