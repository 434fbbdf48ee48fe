"""What the pairing counts for each camera: the outcomes, and everything that should not happen."""

from dataclasses import dataclass, field

from rig.frame import FrameStatus


@dataclass(slots=True)
class CameraCounters:
    """Totals of one camera since the start.

    Attributes:
        outcomes: decided pulses by what became of them.
        late: whole frames whose pulse was decided already.
        duplicate: whole frames that came twice, or a second one for the same pulse.
        unanchored: whole frames that came before the camera's clock was known well enough.
        implausible: whole frames whose device time cannot be true; treated as damaged.
        stale: records of an epoch that is over.
        restarts: times the ids began anew without a new epoch.
        clock_steps: times the device clock was set anew without a new epoch.
        silences: times the camera fell silent while others delivered.
        overruns: pulses that the camera saw but could not follow (trigger counts against ids).
        presumed: pulses decided as lost at their deadline, before the camera's ids could tell.
        contradicted: those of them that the ids later told to have been missed.
        unexplained: frames that the ids tell of but for which there was no pulse.
        unassigned: damaged arrivals for which there was no pulse.
    """

    outcomes: dict[FrameStatus, int] = field(default_factory=lambda: dict.fromkeys(FrameStatus, 0))
    late: int = 0
    duplicate: int = 0
    unanchored: int = 0
    implausible: int = 0
    stale: int = 0
    restarts: int = 0
    clock_steps: int = 0
    silences: int = 0
    overruns: int = 0
    presumed: int = 0
    contradicted: int = 0
    unexplained: int = 0
    unassigned: int = 0

    def to_json(self) -> dict[str, int]:
        """All of them by name, for reports."""
        values = {status.value: count for status, count in self.outcomes.items()}
        for name in self.__slots__:
            if name != "outcomes":
                values[name] = getattr(self, name)
        return values
