"""Sets up a GigE Vision camera, whatever its maker calls the features.

Names are those of the GenICam Standard Features Naming Convention (SFNC 2.7) and those that makers used before it. What
is missing or refuses is told with what it costs. Only what would make a recording wrong is an error: another region,
pixel format or input, a camera that cannot be triggered frame by frame.
"""

from collections.abc import Sequence
from typing import Final

from capture.aravis.action import set_action_trigger
from capture.aravis.features import Features
from rig.action import ActionKeys
from rig.errors import CameraError
from rig.settings.camera import CameraSettings
from rig.settings.region import RegionLimits

#: Triggers that take one frame per pulse, the best first, and the feature that has to be 1 for that.
_ONE_FRAME: Final = {"FrameStart": "", "FrameBurstStart": "AcquisitionBurstFrameCount", "ExposureStart": "",
                     "AcquisitionStart": "AcquisitionFrameCount"}  # fmt: skip
_EDGES: Final = {"rising": "RisingEdge", "falling": "FallingEdge"}
#: What programs that used the camera before may have left on, and what it does.
_SWITCHED_OFF: Final = {
    "AcquisitionFrameRateEnable": "it may ignore pulses that come faster than its own frame rate",
    "AcquisitionFrameRateEnabled": "it may ignore pulses that come faster than its own frame rate",
    "AcquisitionFrameRateAuto": "it may ignore pulses that come faster than its own frame rate",
    "DeviceLinkThroughputLimitMode": "it may send frames too slowly for the pulses",
    "ExposureAuto": "its exposure time changes with the light",
    "GainAuto": "its gain changes with the light",
    "BlackLevelAuto": "its black level changes with the light",
    "BalanceWhiteAuto": "its colours change with the light",
    "GammaEnable": "its grey values are not proportional to the light",
    "GammaEnabled": "its grey values are not proportional to the light",
    "ChunkModeActive": "it adds data to its frames",
    "TestPattern": "it may send a test picture",
    "TestImageSelector": "it may send a test picture",
}
#: Changes of the image that would make every measurement wrong.
_AS_THE_SENSOR_SEES: Final = ("ReverseX", "ReverseY")
_NOT_REDUCED: Final = ("BinningHorizontal", "BinningVertical", "DecimationHorizontal", "DecimationVertical")
#: Exposure and gain may differ so much from those wanted before that is said: steps of the sensor are smaller.
_EXPOSURE_SHARE, _EXPOSURE_US, _GAIN_DB = 0.02, 20.0, 0.5
_LEAST: Final = -1e9
#: The command to expose.
SOFTWARE_TRIGGER: Final = "TriggerSoftware"


def configure(
    features: Features, settings: CameraSettings, *, software: bool, action: ActionKeys | None = None
) -> list[str]:
    """Set everything but the packets, in the order that cameras accept.

    Args:
        features: of the camera.
        settings: of the camera in the rig file.
        software: it exposes at commands, not at pulses of its input.
        action: keys of the action commands at which it exposes; None: at none.

    Returns:
        What could not be set and what that costs, a sentence each.

    Raises:
        CameraError: the camera cannot be set up so that its frames are those of the rig file, one per pulse.
    """
    features.execute("AcquisitionStop")  # a program that crashed may have left it running, which locks most features
    features.set_number("TLParamsLocked", 0)
    notices = [
        f"{name} stays on: {cost}"
        for name, cost in _SWITCHED_OFF.items()
        if features.has(name) and not features.switch(name, on=False)
    ]
    _set_image(features, settings)
    notices += _set_trigger(features, settings, software=software, action=action)
    notices += _set_exposure(features, settings.exposure_us)
    notices += _set_gain(features, settings.gain_db)
    return [f"camera {settings.name}: {notice}" for notice in notices]


def region_limits(features: Features) -> RegionLimits | None:
    """Which regions the camera takes; None if it does not say.

    What is left beside the present region counts too: many cameras limit the size by the offset.
    """
    width, height = features.bounds("Width"), features.bounds("Height")
    x, y = features.bounds("OffsetX") or (0, 0, 1), features.bounds("OffsetY") or (0, 0, 1)
    if width is None or height is None:
        return None
    left, top = features.number("OffsetX") or 0.0, features.number("OffsetY") or 0.0
    return RegionLimits(
        width=round(features.number("WidthMax") or features.number("SensorWidth") or width[1] + left),
        height=round(features.number("HeightMax") or features.number("SensorHeight") or height[1] + top),
        step_x=x[2], step_y=y[2], step_width=width[2], step_height=height[2],
        least_width=max(1, width[0]), least_height=max(1, height[0]),
    )  # fmt: skip


def _set_image(features: Features, settings: CameraSettings) -> None:
    name, region = settings.name, settings.region
    for feature in _AS_THE_SENSOR_SEES:
        if features.has(feature) and not features.switch(feature, on=False):
            raise CameraError(f"camera {name} sends mirrored images and does not let it be changed: set {feature} off")
    for feature in _NOT_REDUCED:
        if (got := features.set_number(feature, 1)) not in {None, 1.0}:
            raise CameraError(f"camera {name} reduces its images ({feature} is {got:g}): set {feature} to 1")
    wanted = {"Width": region.width, "Height": region.height, "OffsetX": region.x, "OffsetY": region.y}
    for feature in ("OffsetX", "OffsetY"):
        features.set_number(feature, 0)  # sizes are limited by the offsets
    for feature, value in wanted.items():
        got = features.set_number(feature, value)
        if got is None:
            got = features.number(feature) or 0.0  # a camera without the feature, or with a fixed one
        if got != value:
            raise CameraError(
                f"camera {name} makes its {feature} {got:g} and not {value}: correct region of {name} in the rig file"
            )
    if features.has("PixelFormat") and features.choose("PixelFormat", settings.pixel_format) is None:
        formats = _list(features.entries("PixelFormat"))
        raise CameraError(
            f"camera {name} has no pixel format {settings.pixel_format} (it has {formats}): "
            f"correct pixel_format of {name}"
        )
    if features.has("AcquisitionMode") and features.choose("AcquisitionMode", "Continuous") is None:
        raise CameraError(f"camera {name} takes no frames one after the other (AcquisitionMode Continuous)")


def _set_trigger(
    features: Features, settings: CameraSettings, *, software: bool, action: ActionKeys | None
) -> list[str]:
    name = settings.name
    selectors = features.entries("TriggerSelector")
    for selector in selectors:
        if features.choose("TriggerSelector", selector):
            features.choose("TriggerMode", "Off")
    chosen = features.choose("TriggerSelector", *_ONE_FRAME)
    count = _ONE_FRAME.get(chosen or "")
    if (selectors and chosen is None) or (count and features.set_number(count, 1) not in {1.0, None}):
        raise CameraError(f"camera {name} has no trigger that takes one frame per pulse (it has {_list(selectors)})")
    if chosen == "AcquisitionStart" and not features.has(_ONE_FRAME[chosen]):
        raise CameraError(f"camera {name} has a trigger that starts it, but none that takes one frame per pulse")
    notices = [] if software or action else _set_input(features, settings)
    for divider in ("TriggerDivider", "TriggerMultiplier"):
        if features.set_number(divider, 1) not in {None, 1.0}:
            notices.append(f"{divider} stays {features.number(divider):g}: it does not take one frame per pulse")
    delay = features.first("TriggerDelay", "TriggerDelayAbs", "TriggerDelayRaw")
    if delay is not None and (left := features.set_number(delay, 0)) != 0:
        notices.append(f"{delay} stays {left or features.number(delay) or 0:g}: it exposes so much later")
    features.choose("TriggerOverlap", "ReadOut", "PreviousFrame")  # else pulses during the readout are ignored
    if features.choose("TriggerMode", "On") is None:
        raise CameraError(f"camera {name} cannot be triggered (TriggerMode): use a camera with a trigger input")
    if action is not None:
        set_action_trigger(features, name, action)
    if software and (features.choose("TriggerSource", "Software") is None or not features.has(SOFTWARE_TRIGGER)):
        sources = _list(features.entries("TriggerSource"))
        raise CameraError(
            f"camera {name} takes no software trigger (its TriggerSource has {sources}): "
            'use [trigger] source = "external"'
        )
    return notices


def _set_input(features: Features, settings: CameraSettings) -> list[str]:
    name, wanted, notices = settings.name, settings.trigger_input, list[str]()
    sources = features.entries("TriggerSource")
    if not sources:
        notices.append(f"its trigger input cannot be chosen: the cable has to be in the one that it uses, not {wanted}")
    elif (source := features.choose("TriggerSource", wanted, "Any")) is None:
        raise CameraError(
            f'camera {name} has no trigger input "{wanted}" (it has {_list(sources)}): correct trigger_input of {name}'
        )
    elif source != wanted:
        notices.append(f"it takes pulses at any of its inputs, not only at {wanted}")
    if features.choose("LineSelector", wanted):
        features.choose("LineMode", "Input")
        debouncer = features.first("LineDebouncerTime", "LineDebouncerTimeAbs")
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


def _set_exposure(features: Features, wanted_us: float) -> list[str]:
    if features.has("ExposureMode") and features.choose("ExposureMode", "Timed") is None:
        return ["its exposure time cannot be set (ExposureMode): motion blur and brightness are what the camera makes"]
    name = features.first("ExposureTime", "ExposureTimeAbs", "Exposure")
    if name is not None:
        got = features.set_number(name, wanted_us)
    else:
        step_us = features.number("ExposureTimeBaseAbs") or 1.0
        steps = features.set_number("ExposureTimeRaw", wanted_us / step_us)
        got = None if steps is None else steps * step_us
    if got is None:
        return ["its exposure time cannot be set: motion blur and brightness are what the camera makes"]
    if abs(got - wanted_us) > max(_EXPOSURE_SHARE * wanted_us, _EXPOSURE_US):
        return [f"it exposes {got:g} us, not {wanted_us:g}"]
    return []


def _set_gain(features: Features, wanted_db: float) -> list[str]:
    features.choose("GainSelector", "All", "AnalogAll")
    name = features.first("Gain", "GainAbs")
    if name is None:
        if features.set_number("GainRaw", _LEAST) is None or wanted_db == 0:
            return [] if wanted_db == 0 else ["it has no gain"]
        return ["its gain has no unit, so it is at its least: make images brighter by exposure_us"]
    got = features.set_number(name, wanted_db)
    if got is None or abs(got - wanted_db) > _GAIN_DB:
        return [f"its gain is {'unknown' if got is None else f'{got:g} dB'}, not {wanted_db:g} dB"]
    return []


def _list(words: Sequence[str]) -> str:
    return ", ".join(words) or "none"
