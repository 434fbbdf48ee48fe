"""How bright it is at any time: clouds, and floodlights that flicker with the mains."""

import math

import numpy as np

from simrig.world.conditions.effects import Light

_PERIODS = (1.0, 0.63, 0.41)  #: of the waves that clouds are made of, in periods of the scenario


class Daylight:
    """Share of the full light; seeded, and the same for all cameras.

    Args:
        light: the scenario's table.
        seed: seed of the scenario.
    """

    def __init__(self, light: Light, seed: int) -> None:
        self._light = light
        phases = np.random.default_rng((seed, 33)).uniform(0, 2 * math.pi, len(_PERIODS) + 1)
        self._phases, self._mains = phases[:-1].tolist(), float(phases[-1])

    def at(self, scene_s: float, exposure_s: float) -> float:
        """Mean over an exposure about scene time `scene_s`, in (0, 1].

        An exposure as long as a period of the flicker sees none of it.
        """
        light = self._light
        waves = (
            math.sin(2 * math.pi * scene_s / (part * light.cloud_period_s) + phase)
            for part, phase in zip(_PERIODS, self._phases, strict=True)
        )
        clouds = 1 - light.cloud_depth * (0.5 + 0.5 * sum(waves) / len(_PERIODS))
        swing = float(np.sinc(light.flicker_hz * exposure_s)) * math.cos(
            2 * math.pi * light.flicker_hz * scene_s + self._mains
        )
        return clouds * (1 - light.flicker / 2 + light.flicker / 2 * swing)
