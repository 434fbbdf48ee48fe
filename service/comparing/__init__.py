"""Compares measured jumps when somebody asks for it: groups of an athlete's, or two of anybody's."""
