"""How long a triplet takes from its last frame in memory until it is on its way to disk and subscribers."""

from itertools import accumulate
from typing import Any, Final

from rig.clocks import NS_PER_S

#: Upper bounds, s. Fixed, so that figures of different days and machines can be added up.
BUCKETS_S: Final = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class LatencyHistogram:
    """Counts times in fixed buckets."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BUCKETS_S) + 1)
        self._sum_s = 0.0

    def add(self, latency_ns: int) -> None:
        """Count one time."""
        seconds = latency_ns / NS_PER_S
        place = sum(seconds > bound for bound in BUCKETS_S)
        self._counts[place] += 1
        self._sum_s += seconds

    def to_json(self) -> dict[str, Any]:
        """Counts up to each bound, cumulative, as Prometheus has them."""
        names = [*(f"{bound:g}" for bound in BUCKETS_S), "+Inf"]
        return {
            "buckets_s": dict(zip(names, accumulate(self._counts), strict=True)),
            "sum_s": round(self._sum_s, 6),
            "count": sum(self._counts),
        }
