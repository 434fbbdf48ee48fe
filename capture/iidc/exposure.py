"""Sets trigger, gain and exposure. The exposure is set last: any other setting may change it back."""

from capture.iidc.avt import AvtRegisters
from capture.iidc.device import Device
from capture.iidc.structures import Feature
from rig.clocks import NS_PER_US
from rig.errors import CameraError
from rig.settings import CameraSettings

#: From the end of the exposure to the first packet (Marlin manual: 500 us +- 62.5 us).
READOUT_NS = 500_000


def set_trigger(device: Device, camera: CameraSettings) -> None:
    """Let the pulses on the camera's input trigger it.

    Raises:
        CameraError: the camera has no such input, mode or edge.
    """
    if not device.has(Feature.TRIGGER):
        raise CameraError(f"camera {camera.name} has no trigger input: use another camera")
    source, sources = int(camera.trigger_input.removeprefix("Line")), device.trigger_sources()
    # Cameras older than IIDC 1.31 have one input and do not number it.
    if source not in (sources or [0]):
        names = " or ".join(f'"Line{number}"' for number in sources or [0])
        raise CameraError(f"camera {camera.name} has no trigger_input {camera.trigger_input}, but {names}: correct it")
    mode = camera.iidc.trigger_mode
    if mode not in device.trigger_modes():
        raise CameraError(f"camera {camera.name} has no trigger mode {mode}: choose another iidc.trigger_mode")
    rising = camera.trigger_edge == "rising"
    device.set_trigger(mode=mode, source=source if sources else None, rising=rising)


def set_gain(device: Device, camera: CameraSettings) -> None:
    """Fixed gain.

    Raises:
        CameraError: the camera cannot have so much.
    """
    if not device.has(Feature.GAIN):
        if camera.gain_db:
            raise CameraError(f"camera {camera.name} has no gain: set gain_db = 0")
        return
    device.set_by_hand(Feature.GAIN)
    if device.has_absolute(Feature.GAIN):
        device.set_absolute(Feature.GAIN, camera.gain_db)
        return
    least, greatest = device.boundaries(Feature.GAIN)
    value = least + round(camera.gain_db / camera.iidc.gain_step_db)
    if value > greatest:
        most = (greatest - least) * camera.iidc.gain_step_db
        raise CameraError(f"camera {camera.name} has {most:.1f} dB of gain at most: lower gain_db")
    device.set_raw(Feature.GAIN, value)


def set_exposure(device: Device, avt: AvtRegisters, camera: CameraSettings) -> None:
    """Exposure time, by the finest way that the camera has. Call it last.

    Raises:
        CameraError: the camera cannot have it, or does not tell its steps.
    """
    if camera.iidc.trigger_mode == 1:
        return  # the pulse is as long as the exposure
    device.set_by_hand(Feature.SHUTTER)
    if avt.extended_shutter:
        avt.set_extended_shutter(camera.exposure_us)
    elif device.has_absolute(Feature.SHUTTER):
        _set_absolute(device, camera)
    elif (steps := avt.shutter_steps(camera.exposure_us, camera.iidc.shutter_offset_us)) is not None:
        device.set_raw(Feature.SHUTTER, steps)
    else:
        raise CameraError(
            f"camera {camera.name} cannot be set to an exposure of {camera.exposure_us:g} us: "
            "choose another exposure_us"
        )


def _set_absolute(device: Device, camera: CameraSettings) -> None:
    least, greatest = device.absolute_boundaries(Feature.SHUTTER)
    if not least <= camera.exposure_us / 1e6 <= greatest:
        raise CameraError(
            f"camera {camera.name} can expose {least * 1e6:.0f} to {greatest * 1e6:.0f} us: correct exposure_us"
        )
    device.set_absolute(Feature.SHUTTER, camera.exposure_us / 1e6)


def longest_delay_ns(camera: CameraSettings, period_ns: int) -> int:
    """The first packet leaves the camera at most so long after the exposure began."""
    exposure_ns = period_ns if camera.iidc.trigger_mode == 1 else round(camera.exposure_us * NS_PER_US)
    return exposure_ns + READOUT_NS + period_ns // 2
