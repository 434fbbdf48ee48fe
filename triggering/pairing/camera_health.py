"""What the health record says of one camera's pairing."""

from typing import Final

import msgspec

from rig.clocks import NS_PER_S, DecimalNs, HostNs
from rig.health import CameraPairing
from triggering.pairing.camera_track import CameraTrack

#: What happened is told for so long.
_RECENT_NS: Final = 10 * NS_PER_S


def is_recent(time: HostNs, last: HostNs | None) -> bool:
    """Whether something happened shortly before the last decided pulse, or after it."""
    return last is not None and last < time + _RECENT_NS


def camera_health(track: CameraTrack, last: HostNs | None) -> CameraPairing:
    """The part of the health record about one camera.

    Args:
        track: the camera.
        last: time of the last decided pulse.
    """
    clock = track.clock
    return CameraPairing(
        connected=track.connected,
        silent=track.silent,
        clock_known=clock.known,
        clock_offset_ns=DecimalNs(clock.offset_ns),
        clock_drift_ppm=round(clock.drift_ppm, 3),
        clock_uncertainty_us=round(clock.uncertainty_ns / 1000, 3) if clock.known else None,
        latency_ms=round(track.latency_ns / 1e6, 3),
        clock_set=track.set_at is not None and is_recent(track.set_at, last),
        **msgspec.structs.asdict(track.counters),
    )
