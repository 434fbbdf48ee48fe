"""Refines a click to a part of a pixel: the centre of a disc, the foot on an edge.

Each is a least-squares fit of a model to the grey values, and its sigma is that of the fit a posteriori. A fit that the
image does not bear out is refused with the reason: a residual that noise and the model's own error leave with a
probability of less than `REFUSED_P`, or a contrast that noise alone may show as well.
"""

from analysis.digitizing.refining.disc_refining import RefinedDisc, refine_disc
from analysis.digitizing.refining.edge_refining import RefinedEdge, refine_edge

__all__ = ["RefinedDisc", "RefinedEdge", "refine_disc", "refine_edge"]
