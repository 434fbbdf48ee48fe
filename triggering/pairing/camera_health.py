"""The parts of the health record about each camera's pairing, and about the source of the pulses."""

from typing import Final

import msgspec

from rig.clocks import NS_PER_S, DecimalNs, HostNs
from rig.health import CameraPairing, SourcePairing
from triggering.pairing.camera.track import CameraTrack
from triggering.timeline.fired import FiredPulses

#: An incident stays in the health record for so long.
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
    times, clock = track.times, track.times.clock
    return CameraPairing(
        connected=track.connected,
        silent=track.silent,
        clock_known=clock.known,
        clock_offset_ns=DecimalNs(clock.offset_ns),
        clock_drift_ppm=round(clock.drift_ppm, 3),
        clock_uncertainty_us=round(clock.uncertainty_ns / 1000, 3) if clock.known else None,
        latency_ms=round(track.latency_ns / 1e6, 3),
        clock_set=times.set_at is not None and is_recent(times.set_at, last),
        clock_from_zero=clock.from_zero,
        doubted=times.plausibility.doubted,
        exposure_subtracted_us=times.stamping.late_ns / 1000,
        **msgspec.structs.asdict(track.counters),
    )


def source_health(fired: FiredPulses, last: HostNs | None) -> SourcePairing | None:
    """The part of the health record about the source of the pulses; None: it does not report its pulses.

    Args:
        fired: the pulses that it reported.
        last: time of the last decided pulse.
    """
    if not fired.active:
        return None
    counts = fired.counts
    return SourcePairing(
        fired=counts.reported,
        unseen=counts.unseen,
        untagged=counts.untagged,
        unfired=counts.unfired,
        period_us=None if fired.period_ns is None else round(fired.period_ns / 1000, 3),
        uncertainty_us=counts.uncertainty_ns / 1000,
        unseen_lately=counts.unseen_at is not None and is_recent(counts.unseen_at, last),
        unfired_lately=counts.unfired_at is not None and is_recent(counts.unfired_at, last),
    )
