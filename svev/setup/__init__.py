"""`svev setup`: asks what a new hill needs, and writes its files; one module for each step."""
