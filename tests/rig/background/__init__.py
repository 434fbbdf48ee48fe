"""Tests of programs that do long work beside the service."""
