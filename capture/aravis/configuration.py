"""Sets up a GigE Vision camera, whatever its maker calls the features.

Names are those of the GenICam Standard Features Naming Convention (SFNC 2.7) and those that makers used before it. What
is missing or refuses is told with what it costs. Only what would make a recording wrong is an error: another region,
pixel format or input, a camera that cannot be triggered frame by frame.
"""

import re
from typing import Final

from capture.aravis.features import Features
from capture.aravis.gain import set_gain
from capture.aravis.trigger import listed, set_trigger, sets_exposure_time
from rig.action import ActionKeys
from rig.errors import CameraError
from rig.settings.camera import CameraSettings
from rig.settings.region import RegionLimits

#: What programs that used the camera before may have left on, and what it does.
_SWITCHED_OFF: Final = {
    "AcquisitionFrameRateEnable": "it may ignore pulses that come faster than its own frame rate",
    "AcquisitionFrameRateEnabled": "it may ignore pulses that come faster than its own frame rate",
    "AcquisitionFrameRateAuto": "it may ignore pulses that come faster than its own frame rate",
    "AcquisitionFrameRateMode": "it may ignore pulses that come faster than its own frame rate",
    "ExposureAuto": "its exposure time changes with the light",
    "BlackLevelAuto": "its black level changes with the light",
    "BalanceWhiteAuto": "its colours change with the light",
    "GammaEnable": "its grey values are not proportional to the light",
    "GammaEnabled": "its grey values are not proportional to the light",
    "LUTEnable": "its grey values are not proportional to the light",
    "SequencerMode": "its settings change from frame to frame",
    "SequenceEnable": "its settings change from frame to frame",
    "ChunkModeActive": "it adds data to its frames",
    "TestPattern": "it may send a test picture",
    "TestImageSelector": "it may send a test picture",
    "ImageCompressionMode": "its frames are compressed",
    "transferTurboMode": "its frames are compressed",
    "StreamHoldEnable": "it keeps its frames to itself",
}
_TRANSFER: Final = "TransferControlMode"
#: Changes of the image that would make every measurement wrong.
_AS_THE_SENSOR_SEES: Final = ("ReverseX", "ReverseY")
#: As an enumeration says that nothing is reduced: 1, x1, Off, BinningHorizontal1.
_ONE: Final = re.compile(r"\D*1|Off|None")
_NOT_REDUCED: Final = ("BinningHorizontal", "BinningVertical", "DecimationHorizontal", "DecimationVertical")
#: Frames per second that exposure, region and link allow, by the names of Basler, Hikrobot, FLIR and Allied Vision.
_FASTEST: Final = (
    "ResultingFrameRateAbs", "BslResultingAcquisitionFrameRate", "ResultingFrameRate", "AcquisitionResultingFrameRate",
    "AcquisitionFrameRateLimit",
)  # fmt: skip
_RATE_SHARE: Final = 0.99
#: Steps of Gamma are smaller.
_GAMMA: Final = 0.01
#: Exposure and gain may differ so much from those wanted before that is said: steps of the sensor are smaller.
_EXPOSURE_SHARE, _EXPOSURE_US = 0.02, 20.0
#: Microseconds in units of exposure times; the convention has microseconds, and many tell no unit.
_UNITS_US: Final = {"s": 1e6, "ms": 1e3, "ns": 1e-3}


def configure(
    features: Features, settings: CameraSettings, rate_hz: float, *, software: bool, action: ActionKeys | None = None
) -> list[str]:
    """Set everything but the packets, in the order that cameras accept.

    Args:
        features: of the camera.
        settings: of the camera in the rig file.
        rate_hz: how often pulses come.
        software: it exposes at commands, not at pulses of its input.
        action: keys of the action commands at which it exposes; None: at none.

    Returns:
        What could not be set and what that costs, a sentence each.

    Raises:
        CameraError: the camera cannot be set up so that its frames are those of the rig file, one per pulse.
    """
    features.execute("AcquisitionStop")  # a program that crashed may have left it running, which locks most features
    features.set_number("TLParamsLocked", 0)
    _switch_off(features)  # some of it locks what is set now
    _set_image(features, settings)
    notices = set_trigger(features, settings, software=software, action=action)
    timed = not features.has("ExposureMode") or sets_exposure_time(features)
    notices += _switch_off(features)  # some of it is there only with this pixel format, trigger and exposure mode
    notices += _set_exposure(features, settings.exposure_us, timed=timed)
    notices += set_gain(features, settings)
    notices += _too_slow(features, rate_hz)
    return [f"camera {settings.name}: {notice}" for notice in notices]


def _switch_off(features: Features) -> list[str]:
    """Switch off what other programs may have left on; what stays on."""
    notices = [
        f"{name} stays {features.chosen(name) or 'on'}: {cost}"
        for name, cost in _SWITCHED_OFF.items()
        if features.has(name) and not features.switch(name, on=False)
    ]
    if features.has(_TRANSFER) and features.choose(_TRANSFER, "Basic", "Automatic") is None:
        notices.append(f"{_TRANSFER} stays {features.chosen(_TRANSFER)}: it sends its frames only when it is told to")
    if not features.has("GammaEnable") and not features.has("GammaEnabled"):
        gamma = features.set_number("Gamma", 1.0)
        if gamma is not None and abs(gamma - 1.0) > _GAMMA:
            notices.append(f"its Gamma stays {gamma:g}: its grey values are not proportional to the light")
    return notices


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
        entries = features.entries(feature)
        if entries and features.choose(feature, *filter(_ONE.fullmatch, entries)) is None:
            raise CameraError(
                f"camera {name} reduces its images ({feature} is {features.chosen(feature)}): set {feature} to 1"
            )
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
        formats = listed(features.entries("PixelFormat"))
        raise CameraError(
            f"camera {name} has no pixel format {settings.pixel_format} (it has {formats}): "
            f"correct pixel_format of {name}"
        )
    if features.has("AcquisitionMode") and features.choose("AcquisitionMode", "Continuous") is None:
        raise CameraError(f"camera {name} takes no frames one after the other (AcquisitionMode Continuous)")


def _set_exposure(features: Features, wanted_us: float, *, timed: bool) -> list[str]:
    if not timed:
        return ["its exposure time cannot be set (ExposureMode): motion blur and brightness are what the camera makes"]
    name = features.first_number("ExposureTime", "ExposureTimeAbs", "Exposure")
    if name is not None:
        step_us = _UNITS_US.get(features.unit(name), 1.0)
    else:
        name = "ExposureTimeRaw"
        step_us = features.number("ExposureTimeBaseAbs") or _UNITS_US.get(features.unit(name), 1.0)
    steps = features.set_number(name, wanted_us / step_us)
    got = None if steps is None else steps * step_us
    if got is None:
        return ["its exposure time cannot be set: motion blur and brightness are what the camera makes"]
    if abs(got - wanted_us) > max(_EXPOSURE_SHARE * wanted_us, _EXPOSURE_US):
        return [f"it exposes {got:g} us, not {wanted_us:g}"]
    return []


def _too_slow(features: Features, rate_hz: float) -> list[str]:
    """Whether the camera says that with these settings it takes fewer frames than pulses come."""
    name = features.first_number(*_FASTEST)
    most = None if name is None else features.number(name)
    if not most or most >= _RATE_SHARE * rate_hz:
        return []
    slow = (
        f"it takes {most:.1f} frames per second at most ({name}), and {rate_hz:g} pulses come: shorten exposure_us, or "
        "choose a smaller region"
    )
    return [slow]
