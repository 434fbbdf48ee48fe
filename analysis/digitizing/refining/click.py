"""A click or a drawn line, found more exactly in its image, as a page asks for it."""

import numpy as np

from analysis.digitizing.refining.refining import refine_disc, refine_edge, refine_line
from rig.api.digitizing import Refined, RefineOrder
from rig.images.picture import Grey


def refined(image: Grey, order: RefineOrder) -> Refined:
    """The place of a thing in an image near a click, by the grey values; of a line that was drawn two places.

    Raises:
        NoFitError: there is no such thing there; the message says why.
    """
    xy = np.array((order.x, order.y))
    if order.kind == "line":
        line = refine_line(image, xy, np.array(order.end))
        (x, y), (end_x, end_y) = line.xy.tolist()
        return Refined(xy=(x, y), end=(end_x, end_y), sigma=(line.sigma, line.sigma), kind=order.kind)
    if order.kind == "edge":
        edge = refine_edge(image, xy)
        place, sigma = edge.xy, (edge.sigma, edge.sigma)
    else:
        disc = refine_disc(image, xy, dark=order.kind == "dark disc")
        place, sigma = disc.xy, (float(disc.sigma[0]), float(disc.sigma[1]))
    return Refined(xy=(float(place[0]), float(place[1])), sigma=sigma, kind=order.kind)
