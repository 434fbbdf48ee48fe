"""Recordings as videos, pictures and tables for people and other programs."""
