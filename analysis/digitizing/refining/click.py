"""A click, found more exactly in its image, as a page asks for it."""

import numpy as np

from analysis.digitizing.refining.refining import refine_disc, refine_edge
from rig.api.digitizing import Refined, RefineOrder
from rig.images.picture import Grey


def refined(image: Grey, order: RefineOrder) -> Refined:
    """The place of a thing in an image near a click, by the grey values.

    Raises:
        NoFitError: there is no such thing there; the message says why.
    """
    xy = np.array((order.x, order.y))
    if order.kind == "edge":
        edge = refine_edge(image, xy)
        place, sigma = edge.xy, (edge.sigma, edge.sigma)
    else:
        disc = refine_disc(image, xy, dark=order.kind == "dark disc")
        place, sigma = disc.xy, (float(disc.sigma[0]), float(disc.sigma[1]))
    return Refined(xy=(float(place[0]), float(place[1])), sigma=sigma, kind=order.kind)
