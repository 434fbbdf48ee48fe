"""The bundle adjustment (paper, appendix D): any network of `photogrammetry.network`, solved with honest sigmas.

`adjust` is the front door; the other modules do one thing each.
"""
