"""How fast a GigE Vision camera sends its frames.

Other programs leave limits behind, and some cameras have one that cannot be switched off.
"""

import math
from typing import Final

from capture.aravis.features import Features

_LIMIT_MODE: Final = "DeviceLinkThroughputLimitMode"
#: Bytes per second: of the convention, and of Allied Vision.
_LIMITS: Final = ("DeviceLinkThroughputLimit", "StreamBytesPerSecond")


def open_wide(features: Features) -> list[str]:
    """Have a camera send as fast as it can.

    Returns:
        What could not be set and what that costs, a sentence each.
    """
    features.switch(_LIMIT_MODE, on=False)
    if features.chosen(_LIMIT_MODE) == "Off":
        return []
    notices = []
    for name in _LIMITS:
        if features.has(name) and features.set_number(name, math.inf) is None:
            notices.append(
                f"{name} stays {features.number(name) or 0:g} bytes/s: it may send too slowly for the pulses"
            )
    return notices
