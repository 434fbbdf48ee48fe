"""The rate of the pulses, changed while the rig runs, and written into the text of the rig file."""

import tomlkit

from rig.errors import BadInputError
from rig.settings.editing import as_toml, editable
from rig.settings.model import RigSettings
from rig.settings.strict_toml import validate


def with_rate(rig: RigSettings, rate_hz: float) -> RigSettings:
    """The rig with another rate of its pulses.

    Args:
        rig: the rig.
        rate_hz: pulses per second.

    Raises:
        BadInputError: the source does not take the rate, or a camera would expose for longer than from pulse to pulse.
    """
    changed = rig.trigger.model_dump(exclude_unset=True) | {"rate_hz": rate_hz}
    trigger = validate(type(rig.trigger), changed, "trigger")
    longest = max(rig.cameras, key=lambda camera: camera.exposure_us)
    period_us = trigger.period_ns / 1000
    if longest.exposure_us >= period_us:
        raise BadInputError(
            f"at {rate_hz:g} Hz pulses would come every {period_us / 1000:.1f} ms, and camera {longest.name} exposes "
            f"for {longest.exposure_us / 1000:g} ms: choose a lower rate, or shorten its exposure first"
        )
    return rig.model_copy(update={"trigger": trigger})


def written_rate(text: str, rate_hz: float) -> str:
    """The text of a rig file with another rate of the pulses; everything else in it stays as it is.

    Raises:
        BadInputError: the text is not TOML, or has no trigger.
    """
    document = editable(text)
    trigger = document.get("trigger")
    if not isinstance(trigger, dict):
        raise BadInputError("the rig file has no [trigger] any more: start the service again")
    trigger["rate_hz"] = as_toml(rate_hz)
    return tomlkit.dumps(document)
