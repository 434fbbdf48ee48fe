"""Has a GigE Vision camera take one frame per pulse, command or action, whatever its maker calls that.

Nearly all cameras have TriggerSelector, TriggerMode and TriggerSource (SFNC 2.7, chapter 8). Older JAI cameras have
none of the first two: their ExposureMode says that a pulse begins the exposure, and the pulse comes from what is chosen
as the source of the line CameraTrigger0.
"""

from collections.abc import Sequence
from typing import Final

from capture.aravis.action import set_action_trigger
from capture.aravis.features import Features
from rig.action import ActionKeys
from rig.errors import CameraError
from rig.settings.camera import CameraSettings

#: The command to expose.
SOFTWARE_TRIGGER: Final = "TriggerSoftware"
#: Triggers that take one frame per pulse, the best first, and the feature to be set to 1 for it.
_ONE_FRAME: Final = {"FrameStart": "", "FrameBurstStart": "AcquisitionBurstFrameCount", "ExposureStart": "",
                     "AcquisitionStart": "AcquisitionFrameCount"}  # fmt: skip
#: How long an input waits for a steady level, by the names of Hikrobot, Basler, Teledyne Dalsa, FLIR and Allied Vision.
_DEBOUNCERS: Final = (
    "LineDebouncerTime", "LineDebouncerTimeAbs", "lineDebouncingPeriod", "LineFilterWidth", "LineDebounceDuration",
)  # fmt: skip
_EDGES: Final = {"rising": "RisingEdge", "falling": "FallingEdge"}
#: Exposure modes by which a pulse begins an exposure of `exposure_us`, without TriggerMode.
_BY_EXPOSURE_MODE: Final = ("EdgePreSelect", "EdgePreselect")
_TRIGGER_LINE: Final = "CameraTrigger0"
#: How the line of such a camera is turned round, by edge of the pulse.
_LINE_LEVELS: Final = {"rising": ("ActiveHigh", "Off"), "falling": ("ActiveLow", "On")}


def set_trigger(
    features: Features, settings: CameraSettings, *, software: bool, action: ActionKeys | None
) -> list[str]:
    """Have a camera take one frame per pulse of its input, or per command or action.

    Args:
        features: of the camera.
        settings: of the camera in the rig file.
        software: it exposes at commands, not at pulses of its input.
        action: keys of the action commands at which it exposes; None: at none.

    Returns:
        What could not be set and what that costs, a sentence each.

    Raises:
        CameraError: it cannot be triggered so.
    """
    if not features.has("TriggerMode") and features.choose("ExposureMode", *_BY_EXPOSURE_MODE):
        return _set_line(features, settings, software=software, action=action)
    name = settings.name
    _select(features, name)
    # With some makers sources are there only while the trigger is on.
    at_once = features.has("TriggerSource")
    by_cable = not software and action is None
    notices = _set_input(features, settings) if by_cable and at_once else []
    for divider in ("TriggerDivider", "TriggerMultiplier"):
        if features.set_number(divider, 1) not in {None, 1.0}:
            notices.append(f"{divider} stays {features.number(divider):g}: it does not take one frame per pulse")
    delay = features.first_number("TriggerDelay", "TriggerDelayAbs", "TriggerDelayRaw")
    if delay is not None and (left := features.set_number(delay, 0)) != 0:
        notices.append(f"{delay} stays {left or features.number(delay) or 0:g}: it exposes so much later")
    features.choose("TriggerOverlap", "ReadOut", "PreviousFrame")  # else pulses during the readout are ignored
    if not _switch_on(features):
        raise CameraError(f"camera {name} cannot be triggered ({_why_not(features)}): use another camera")
    if by_cable and not at_once:
        notices += _set_input(features, settings)
    if action is not None:
        set_action_trigger(features, name, action, "TriggerSource")
    if software and (features.choose("TriggerSource", "Software") is None or not features.has(SOFTWARE_TRIGGER)):
        raise _no_software(name, "TriggerSource", features)
    return notices


def sets_exposure_time(features: Features) -> bool:
    """Have the exposure last as long as is said, and not as long as the pulse; whether it does."""
    features.choose("ShutterMode", "ExposureTimeAbs", "ProgrammableExposure")  # beside such an exposure mode
    return features.chosen("ExposureMode") in _BY_EXPOSURE_MODE or features.choose("ExposureMode", "Timed") is not None


def _switch_on(features: Features) -> bool:
    """Switch the selected trigger on: an enumeration, which may have further modes, or a boolean."""
    if features.entries("TriggerMode"):
        return features.choose("TriggerMode", "On") is not None
    return features.switch("TriggerMode", on=True)


def _select(features: Features, name: str) -> None:
    """Switch all triggers off, and select the one that takes one frame per pulse."""
    selectors = features.entries("TriggerSelector")
    for selector in selectors:
        if features.choose("TriggerSelector", selector):
            features.switch("TriggerMode", on=False)
    chosen = features.choose("TriggerSelector", *_ONE_FRAME)
    count = _ONE_FRAME.get(chosen or "")
    if (selectors and chosen is None) or (count and features.set_number(count, 1) not in {1.0, None}):
        raise CameraError(f"camera {name} has no trigger that takes one frame per pulse (it has {listed(selectors)})")
    if chosen == "AcquisitionStart" and not features.has(_ONE_FRAME[chosen]):
        raise CameraError(f"camera {name} has a trigger that starts it, but none that takes one frame per pulse")


def _set_line(features: Features, settings: CameraSettings, *, software: bool, action: ActionKeys | None) -> list[str]:
    """Choose what comes in at the trigger line of a camera that its exposure mode triggers."""
    name, notices = settings.name, list[str]()
    features.choose("LineSelector", _TRIGGER_LINE)
    if software:
        raise _no_software(name, "LineSource", features)
    if action is not None:
        set_action_trigger(features, name, action, "LineSource")
        return []
    if features.choose("LineSource", settings.trigger_input) is None:
        raise _no_input(settings, features.entries("LineSource"))
    turned = [features.choose(each, *_LINE_LEVELS[settings.trigger_edge]) for each in ("LineInverter", "LinePolarity")]
    if not any(turned) and not features.switch("LineInverter", on=settings.trigger_edge == "falling"):
        notices.append("the edge of the pulse cannot be chosen: most cameras expose at the rising one")
    return notices


def _set_input(features: Features, settings: CameraSettings) -> list[str]:
    wanted, notices = settings.trigger_input, list[str]()
    sources = features.entries("TriggerSource")
    if not sources:
        notices.append(f"its trigger input cannot be chosen: the cable has to be in the one that it uses, not {wanted}")
    elif (source := features.choose("TriggerSource", wanted, "Any")) is None:
        raise _no_input(settings, sources)
    elif source != wanted:
        notices.append(f"it takes pulses at any of its inputs, not only at {wanted}")
    if features.choose("LineSelector", wanted):
        features.choose("LineMode", "Input")
        if features.has("LineInverter") and not features.switch("LineInverter", on=False):
            notices.append("its input is turned round (LineInverter): it exposes at the other edge of a pulse")
        debouncer = features.first_number(*_DEBOUNCERS)
        if debouncer is not None and (wait := features.number(debouncer)):
            notices.append(f"its input waits {wait:g} us for a steady level ({debouncer}): it exposes so much later")
    edge = _EDGES[settings.trigger_edge]
    if features.has("TriggerActivation"):
        if features.choose("TriggerActivation", edge) is None:
            taken = features.chosen("TriggerActivation")
            notices.append(f"it does not expose at the {settings.trigger_edge} edge of a pulse, but at {taken}")
    elif settings.trigger_edge != "rising":
        notices.append("the edge of the pulse cannot be chosen: most cameras expose at the rising one")
    return notices


def _why_not(features: Features) -> str:
    """What a camera has instead of a trigger that this program knows."""
    modes, exposures = features.entries("TriggerMode"), features.entries("ExposureMode")
    if modes:
        return f"its TriggerMode has {listed(modes)} and stays {features.chosen('TriggerMode')}"
    if exposures:
        return f"it has no TriggerMode, and its ExposureMode has {listed(exposures)}, none of which is known here"
    return "it has no TriggerMode"


def _no_input(settings: CameraSettings, sources: Sequence[str]) -> CameraError:
    name, wanted = settings.name, settings.trigger_input
    return CameraError(
        f'camera {name} has no trigger input "{wanted}" (it has {listed(sources)}): correct trigger_input of {name}'
    )


def _no_software(name: str, source: str, features: Features) -> CameraError:
    return CameraError(
        f"camera {name} takes no software trigger (its {source} has {listed(features.entries(source))}): "
        'use [trigger] source = "external"'
    )


def listed(words: Sequence[str]) -> str:
    """Names in a message."""
    return ", ".join(words) or "none"
