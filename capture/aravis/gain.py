"""Sets the gain of a GigE Vision camera, which makers have in dB, as a factor, or in steps of their own.

`Gain` is in dB by the convention (SFNC 2.7, chapter 6). JAI and Teledyne Dalsa have a factor from 1 on, without a unit;
older cameras have steps alone, as `GainRaw` or as an integer `Gain`. Behind `GainSelector` there may be several:
the first one of the sensor carries the gain of the rig file, the others must not change it.
"""

import math
from typing import Final

from capture.aravis.features import Features
from rig.settings.camera import CameraSettings

#: The gain of the whole sensor, the best first.
_WHOLE: Final = ("All", "AnalogAll", "SensorAll", "SensorAnalog", "Analog", "Tap1")
#: Gains behind the sensor, which only multiply noise and grey values.
_DIGITAL: Final = ("DigitalAll", "Digital")
#: Units of a gain in dB or as a factor; others are the maker's own.
_UNITS: Final = ("db", "x", "")
#: Gain may differ so much from that wanted before that is said: steps of the sensor are smaller.
_GAIN_DB: Final = 0.5


def gain_steps(features: Features) -> tuple[int, int] | None:
    """Least and largest gain of a camera that has it in steps alone; None for others."""
    name = _steps(features)
    bounds = None if name is None or _measured(features) else features.bounds(name)
    return None if bounds is None else bounds[:2]


def set_gain(features: Features, settings: CameraSettings) -> list[str]:
    """Have gain as the rig file says, and nothing change it.

    Args:
        features: of the camera.
        settings: of the camera in the rig file.

    Returns:
        What could not be set and what that costs, a sentence each.
    """
    notices = []
    selectors = features.entries("GainSelector")
    for selector in selectors or [""]:
        if selector and features.choose("GainSelector", selector) is None:
            continue
        if features.has("GainAuto") and not features.switch("GainAuto", on=False):
            stays = features.chosen("GainAuto") or "on"
            notices.append(f"GainAuto stays {stays}: its gain changes with the light")
        if selector in _DIGITAL and set(selectors) & set(_WHOLE) and (name := _measured(features)):
            got = _set_db(features, name, 0.0)
            if got is not None and abs(got) > _GAIN_DB:
                notices.append(f"its gain {selector} stays {got:.1f} dB: its grey values are multiplied")
    features.choose("GainSelector", *_WHOLE)
    return notices + (
        _set_whole(features, settings) if settings.gain_raw is None else _set_steps(features, settings.gain_raw)
    )


def _set_whole(features: Features, settings: CameraSettings) -> list[str]:
    wanted_db = settings.gain_db
    if (name := _measured(features)) is not None:
        got = _set_db(features, name, wanted_db)
        if got is None or abs(got - wanted_db) > _GAIN_DB:
            return [f"its gain is {'unknown' if got is None else f'{got:.3g} dB'}, not {wanted_db:g} dB"]
        return []
    name = _steps(features)
    bounds = None if name is None else features.bounds(name)
    if bounds is None:
        if (name := features.first_number("Gain", "GainAbs")) is not None:
            return [f"its gain is in {features.unit(name)}, not in dB: it stays as it was left"]
        return ["it has no gain"] if wanted_db else []
    least, most, _ = bounds
    if settings.gain_step_db is not None:
        return _set_steps(features, least + round(wanted_db / settings.gain_step_db))
    notices = _set_steps(features, least)
    if wanted_db:
        notices.append(
            f"its gain has no unit ({name}, {least} to {most}), so it is at its least: set gain_raw, or gain_step_db "
            "from its manual"
        )
    return notices


def _measured(features: Features) -> str | None:
    """The gain in dB or as a factor, if there is one: an integer in anything else counts steps."""
    name = features.first_number("Gain", "GainAbs")
    units = _UNITS if name is None or features.bounds(name) is None else _UNITS[:1]
    return name if name is not None and features.unit(name).lower() in units else None


def _steps(features: Features) -> str | None:
    """The gain in steps, if there is one."""
    return next((name for name in ("GainRaw", "Gain") if features.bounds(name) is not None), None)


def _set_db(features: Features, name: str, wanted_db: float) -> float | None:
    """Set a gain in dB or as a factor; what it is now, dB, or None."""
    if features.unit(name).lower() == "db" or features.least(name) != 1.0:
        return features.set_number(name, wanted_db)
    factor = features.set_number(name, 10 ** (wanted_db / 20))
    return None if not factor else 20 * math.log10(factor)


def _set_steps(features: Features, wanted: int) -> list[str]:
    """Set the gain in the camera's own steps."""
    name = _steps(features)
    bounds = None if name is None else features.bounds(name)
    if name is None or bounds is None:
        return ["it has no gain in steps, so gain_raw sets nothing: use gain_db"]
    least, most, step = bounds
    got = features.set_number(name, wanted)
    got = features.number(name) if got is None else got
    if got is None or abs(got - wanted) > step / 2:
        return [f"its {name} is {'unknown' if got is None else f'{got:g}'}, not {wanted} (it takes {least} to {most})"]
    return []
