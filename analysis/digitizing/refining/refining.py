"""Refines to a part of a pixel: a click to the centre of a disc or the foot on an edge, a drawn line to edge or bar.

Each is a least-squares fit of a model to the grey values, and its sigma is that of the fit a posteriori. A fit that the
image does not bear out is refused with the reason: a residual that noise and the model's own error leave with a
probability of less than `REFUSED_P`, or a contrast that noise alone may show as well.
"""

from analysis.digitizing.refining.disc_refining import RefinedDisc, refine_disc
from analysis.digitizing.refining.edge_refining import RefinedEdge, RefinedLine, refine_edge, refine_line

__all__ = ["RefinedDisc", "RefinedEdge", "RefinedLine", "refine_disc", "refine_edge", "refine_line"]
