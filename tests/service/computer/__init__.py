"""Processor, memory and processes that are short or stopped."""
