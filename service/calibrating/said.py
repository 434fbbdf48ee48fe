"""What the programs of the calibration helper say, as the REST API tells it."""

from collections.abc import Mapping
from typing import Any, Final

from rig.api.calibrating import CalibratedLens, SeenTarget
from rig.api.statement import Level, Statement
from rig.phrase import Phrase, from_plain
from rig.settings.camera import Region

_MIRRORED: Final = Statement(
    level=Level.WARNING,
    code="target_mirrored",
    text="the picture shows the target in a mirror",
    advice="turn off the mirror or flip of the camera",
)


def seen(name: str, region: Region, said: Mapping[str, Any] | None, *, looking: bool) -> SeenTarget:
    """What a camera shows; `said`: by `finding`, None: nothing yet; its corners count while it is looking."""
    nothing = SeenTarget(camera=name, width=region.width, height=region.height)
    if said is None:
        return nothing
    return nothing.model_copy(
        update={
            "corners": tuple(map(tuple, said["corners"])) if looking else (),
            "pictures": said["pictures"],
            "cells": tuple(map(tuple, said["cells"])),
            "missing": tuple(_stated(from_plain(each)) for each in said["missing"]),
        }
    )


def problem_in(said: Mapping[str, Any]) -> Statement | None:
    """What is wrong, if something is."""
    if "problem" in said:
        return _stated(from_plain(said["problem"])).model_copy(update={"level": Level.ERROR})
    return _MIRRORED if said.get("mirrored") else None


def lens(said: Mapping[str, Any]) -> CalibratedLens:
    """What `computing` says of a camera."""
    advice = tuple(_stated(from_plain(each)) for each in said["advice"])
    return CalibratedLens.model_validate({**said, "verdict": _stated(from_plain(said["verdict"])), "advice": advice})


def _stated(said: Phrase) -> Statement:
    return Statement(code=said.code, text=said.text, values=said.values)
