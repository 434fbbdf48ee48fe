"""How often a camera shows each marker: a binding nearly always from its own side, less from the other one.

The near leg and the near ski hide the far binding. So a lone binding is rather the one on the side of the cameras that
show it. For bodies of the simulated hill (`bench.corpus.draws`, 120 scenes) the far one is in sight in 0.45 of the
images where the camera looks straight from the side, in 0.7 to 0.85 where it looks askew, and the near one in all.

That a camera misses a marker says less: where one has too little contrast, it is missed from any side and for long.
"""

from typing import Final

import numpy as np

from analysis.identification.space.views import Views
from rig.arrays import Floats

#: By how much less often the far binding is in sight, for a camera straight beside the jumper.
_HIDDEN: Final = 0.5
#: Of P1 to P4: 1 for what is on the left side, -1 on the right one, 0 in the middle.
_SIDE: Final = np.array((0.0, 0.0, -1.0, 1.0))


def shown(views: Views, places: Floats, left: Floats) -> Floats:
    """The share of the images that show each marker, as far as the body hides it.

    Args:
        views: the m cameras.
        places: (..., 4, 3) of the markers in the order of `POINTS`, or (..., 1, 3) of the jumper, m.
        left: (3,) unit vector to his left side.

    Returns:
        (..., 4, m).
    """
    way = views.position - places[..., None, :]
    aside = way @ left / np.linalg.norm(way, axis=-1)
    return np.asarray(1.0 + _HIDDEN * np.minimum(_SIDE[:, None] * aside, 0.0))
