"""Sets up a GigE Vision camera that exposes at action commands, and has PTP lock its clock where they are scheduled.

Names are those of the GenICam Standard Features Naming Convention (SFNC 2.7, chapters 2, 16 and 27).
"""

import re
import time
from typing import Final

from capture.aravis.features import Features
from rig.action import ActionKeys
from rig.clocks import NS_PER_S
from rig.errors import CameraError

#: Features that switch PTP on, and those of its state: of the convention, Basler and FLIR before it, Allied Vision,
#: Teledyne Dalsa.
_PTP: Final = (
    ("PtpEnable", ("PtpStatus",)), ("GevIEEE1588", ("GevIEEE1588StatusLatched", "GevIEEE1588Status")),
    ("PtpMode", ("PtpStatus",)), ("ptpMode", ("ptpStatus",)),
)  # fmt: skip
#: With most makers the status is that of the last of these commands.
_LATCHES: Final = ("PtpDataSetLatch", "GevIEEE1588DataSetLatch")
#: Of `PtpMode`: it finds the master by itself, as the switches of the others have it, or follows one.
_FOLLOWS: Final = ("Auto", "Automatic", "Slave")
#: Its clock is that of all cameras: it follows the master, or is the master itself.
_LOCKED: Final = frozenset({"Slave", "Master"})
#: A camera whose clock is not locked after so long is tried again later.
_LOCK_S: Final = 3.0
_LOOK_S: Final = 0.05


def set_action_trigger(features: Features, name: str, keys: ActionKeys, trigger: str) -> None:
    """Have a camera, whose trigger is selected, expose at action commands.

    Args:
        features: of the camera.
        name: of the camera.
        keys: of the commands.
        trigger: the feature by which the source of the trigger is chosen.

    Raises:
        CameraError: it has no such trigger, or does not take the keys.
    """
    there = features.entries(trigger)
    signals = sorted(int(each.removeprefix("Action")) for each in there if re.fullmatch(r"Action\d+", each))
    # The signal whose keys can be set. With some makers they are those of the only one, whatever number it has.
    signals.sort(key=lambda signal: not _select(features, signal))
    if not signals or features.choose(trigger, f"Action{signals[0]}") is None:
        raise CameraError(
            f"camera {name} has no action trigger (its {trigger} has {', '.join(there) or 'none'}): use "
            '[trigger] source = "external"'
        )
    _select(features, signals[0])
    for feature, key in (
        ("ActionDeviceKey", keys.device), ("ActionGroupKey", keys.group), ("ActionGroupMask", keys.mask),
    ):  # fmt: skip
        if not features.write(feature, key):
            raise CameraError(
                f"camera {name} does not take the keys of action commands ({feature}): use its newest firmware, or "
                '[trigger] source = "external"'
            )
    # Without it a camera calls whatever goes wrong by the same status.
    features.choose("GevGVCPExtendedStatusCodesSelector", "Version2_0")
    features.switch("GevGVCPExtendedStatusCodes", on=True)


def _select(features: Features, signal: int) -> bool:
    """Select the action signal whose keys are set from now on; whether the camera lets it be selected."""
    if features.entries("ActionSelector"):
        return features.choose("ActionSelector", f"Action{signal}", str(signal)) is not None
    return features.set_number("ActionSelector", signal) == signal


def lock_clock(features: Features, name: str) -> None:
    """Switch PTP on, and wait until the camera's clock is locked.

    Args:
        features: of the camera.
        name: of the camera.

    Raises:
        CameraError: it has no PTP, or its clock is not locked after some seconds.
    """
    enable, states = next(((enable, states) for enable, states in _PTP if features.has(enable)), ("", ()))
    if not enable or not (features.choose(enable, *_FOLLOWS) or features.switch(enable, on=True)):
        raise CameraError(
            f"camera {name} has no PTP, which scheduled action commands need: set trigger.scheduled = false, or use "
            '[trigger] source = "external"'
        )
    status = next(filter(features.has, states), "its status")
    end = time.monotonic() + _LOCK_S
    while (state := _latched(features, status)) not in _LOCKED:
        if time.monotonic() > end:
            raise CameraError(
                f"camera {name} has no PTP lock ({status} is {state or 'unknown'}): check the PTP master and the "
                "switch; it is tried again"
            )
        time.sleep(_LOOK_S)
    tick_hz = features.number("GevTimestampTickFrequency")
    if tick_hz not in {None, float(NS_PER_S)}:
        raise CameraError(
            f"camera {name} counts {tick_hz:g} ticks per second though PTP is on, not ns: use its newest firmware"
        )


def _latched(features: Features, status: str) -> str | None:
    """Present state of PTP; None if the camera does not tell."""
    for latch in _LATCHES:
        features.execute(latch)
    return features.chosen(status)
