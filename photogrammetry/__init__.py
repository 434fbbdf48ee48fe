"""Photogrammetry for the three cameras: calibration, pose estimation, intersection, planning; numpy and scipy alone.

A program needs only the names below; `docs/how-to/programs.md` shows them. They are loaded when first used, so that
whoever needs one module of this package does not load all.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from photogrammetry.exchange.importing import import_network
    from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
    from photogrammetry.network.model import Network
    from photogrammetry.programming.functions import adjust, calibrate, network_from, orient, read, write
    from photogrammetry.programming.results import Result
    from photogrammetry.programming.space import (
        SpaceLine,
        SpacePoint,
        StickAngles,
        intersect_lines,
        intersect_points,
        stick_angles,
    )
    from photogrammetry.programming.views import View, views_of
    from rig.errors import BadInputError

__all__ = [
    "BadInputError",
    "Network",
    "NotConvergedError",
    "NotSolvableError",
    "RefusedError",
    "Result",
    "SpaceLine",
    "SpacePoint",
    "StickAngles",
    "View",
    "adjust",
    "calibrate",
    "import_network",
    "intersect_lines",
    "intersect_points",
    "network_from",
    "orient",
    "read",
    "stick_angles",
    "views_of",
    "write",
]

#: Modules by what is taken from them.
_HOMES: Final = {
    "photogrammetry.exchange.importing": ("import_network",),
    "photogrammetry.network.diagnosis": ("NotConvergedError", "NotSolvableError", "RefusedError"),
    "photogrammetry.network.model": ("Network",),
    "photogrammetry.programming.functions": ("adjust", "calibrate", "network_from", "orient", "read", "write"),
    "photogrammetry.programming.results": ("Result",),
    "photogrammetry.programming.space": (
        "SpaceLine",
        "SpacePoint",
        "StickAngles",
        "intersect_lines",
        "intersect_points",
        "stick_angles",
    ),
    "photogrammetry.programming.views": ("View", "views_of"),
    "rig.errors": ("BadInputError",),
}


if not TYPE_CHECKING:  # a type checker knows all names from above, and finds wrong ones

    def __getattr__(name: str) -> Any:
        for home, names in _HOMES.items():
            if name in names:
                return getattr(import_module(home), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
