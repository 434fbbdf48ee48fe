"""Sets up a GigE Vision camera, whatever its maker calls the features.

Names are those of the GenICam Standard Features Naming Convention (SFNC 2.7) and those that makers used before it. What
is missing or refuses is told with what it costs. Only what would make a recording wrong is an error: another region,
pixel format or input, a camera that cannot be triggered frame by frame.
"""

from typing import Final

from capture.aravis.features import Features
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
_ONE: Final = ("1", "x1", "Off", "None")  # as an enumeration says that nothing is reduced
_NOT_REDUCED: Final = ("BinningHorizontal", "BinningVertical", "DecimationHorizontal", "DecimationVertical")
#: Frames per second that exposure, region and link allow, by the names of Basler, Hikrobot, FLIR and Allied Vision.
_FASTEST: Final = (
    "ResultingFrameRateAbs", "BslResultingAcquisitionFrameRate", "ResultingFrameRate", "AcquisitionResultingFrameRate",
    "AcquisitionFrameRateLimit",
)  # fmt: skip
_RATE_SHARE: Final = 0.99
#: Exposure and gain may differ so much from those wanted before that is said: steps of the sensor are smaller.
_EXPOSURE_SHARE, _EXPOSURE_US, _GAIN_DB = 0.02, 20.0, 0.5


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
    notices = [
        f"{name} stays on: {cost}"
        for name, cost in _SWITCHED_OFF.items()
        if features.has(name) and not features.switch(name, on=False)
    ]
    _set_image(features, settings)
    notices += set_trigger(features, settings, software=software, action=action)
    notices += _set_exposure(features, settings.exposure_us)
    notices += _set_gain(features, settings)
    notices += _too_slow(features, rate_hz)
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
        if features.entries(feature) and features.choose(feature, *_ONE) is None:
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


def _set_exposure(features: Features, wanted_us: float) -> list[str]:
    if features.has("ExposureMode") and not sets_exposure_time(features):
        return ["its exposure time cannot be set (ExposureMode): motion blur and brightness are what the camera makes"]
    name = features.first_number("ExposureTime", "ExposureTimeAbs", "Exposure")
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


def gain_steps(features: Features) -> tuple[int, int] | None:
    """Least and largest gain of a camera that has it in steps alone; None for others."""
    bounds = None if features.first_number("Gain", "GainAbs") else features.bounds("GainRaw")
    return None if bounds is None else bounds[:2]


def _set_gain(features: Features, settings: CameraSettings) -> list[str]:
    features.choose("GainSelector", "All", "AnalogAll")
    if settings.gain_raw is not None:
        return _set_gain_steps(features, settings.gain_raw)
    name, wanted_db = features.first_number("Gain", "GainAbs"), settings.gain_db
    if name is not None:
        got = features.set_number(name, wanted_db)
        if got is None or abs(got - wanted_db) > _GAIN_DB:
            return [f"its gain is {'unknown' if got is None else f'{got:g} dB'}, not {wanted_db:g} dB"]
        return []
    bounds = features.bounds("GainRaw")
    if bounds is None:
        return ["it has no gain"] if wanted_db else []
    least, most, _ = bounds
    if settings.gain_step_db is not None:
        return _set_gain_steps(features, least + round(wanted_db / settings.gain_step_db))
    notices = _set_gain_steps(features, least)
    if wanted_db:
        notices.append(
            f"its gain has no unit (GainRaw, {least} to {most}), so it is at its least: set gain_raw, or gain_step_db "
            "from its manual"
        )
    return notices


def _set_gain_steps(features: Features, wanted: int) -> list[str]:
    """Set the gain in the camera's own steps."""
    bounds = features.bounds("GainRaw")
    if bounds is None:
        return ["it has no GainRaw, so gain_raw sets nothing: use gain_db"]
    least, most, step = bounds
    got = features.set_number("GainRaw", wanted)
    got = features.number("GainRaw") if got is None else got
    if got is None or abs(got - wanted) > step / 2:
        return [f"its GainRaw is {'unknown' if got is None else f'{got:g}'}, not {wanted} (it takes {least} to {most})"]
    return []
