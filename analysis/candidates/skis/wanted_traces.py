"""Traces of skis, sought only when somebody asks for them: most of what moves in a scene is no jumper.

An image keeps what is in front of the static scene; the traces of a part of it are found at the first question, once.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias, overload

import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.model import ExpectedSki, Trace
from analysis.candidates.skis.traces import find_traces
from rig.arrays import Floats

Change: TypeAlias = Callable[[tuple[Trace, ...]], tuple[Trace, ...]]


class _Part:
    """A part of an image; it gives its pixels back when its traces have been found."""

    def __init__(self, region: Region, expected: Sequence[ExpectedSki]) -> None:
        self._region: Region | None = region
        self._expected = expected
        self._found: tuple[Trace, ...] = ()
        self._low = np.array((region.x, region.y), float)
        self._high = self._low + region.grey.shape[::-1] - 1

    def traces(self) -> tuple[Trace, ...]:
        """Its traces; two threads that ask at the same time both find the same ones."""
        region = self._region
        if region is not None:
            self._found = find_traces(region, self._expected)
            self._region = None
        return self._found

    def touches(self, places: Floats, reach: Floats) -> bool:
        """Whether some of it lies within `reach` (n,) px of one of the places (n, 2), in columns and rows."""
        off = np.maximum(np.maximum(self._low - places, places - self._high), 0.0)
        return bool((off.max(axis=1) <= reach).any())


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class WantedTraces(Sequence[Trace]):
    """The traces of an image, sought when they are asked for, part by part.

    Attributes:
        parts: of the image.
        changes: what is done to the traces that were found, one after the other.
        origin: what they were before; None: nothing was done. It lives as long as they do: whoever made it finds its
            traces before the pixels are forgotten.
    """

    parts: tuple[_Part, ...]
    changes: tuple[Change, ...] = ()
    origin: "WantedTraces | None" = None

    @classmethod
    def of(cls, regions: Sequence[Region], expected: Sequence[ExpectedSki] = ()) -> "WantedTraces":
        """Those of some parts of an image, where skis may be expected."""
        return cls(tuple(_Part(region, expected) for region in regions))

    def changed(self, change: Change) -> "WantedTraces":
        """The same traces after a change, which moves them by a few px at most."""
        return WantedTraces(self.parts, (*self.changes, change), self)

    def near(self, places: Floats, reach: Floats) -> tuple[Trace, ...]:
        """The traces of the parts that lie within `reach` (n,) px of one of the places (n, 2); NaN is nowhere."""
        return self._of([part for part in self.parts if part.touches(places, reach)])

    def find(self) -> tuple[Trace, ...]:
        """All traces; from now on the pixels are not needed."""
        return self._of(self.parts)

    def _of(self, parts: Sequence[_Part]) -> tuple[Trace, ...]:
        found = tuple(trace for part in parts for trace in part.traces())
        for change in self.changes:
            found = change(found)
        return found

    def __len__(self) -> int:
        return len(self.find())

    def __iter__(self) -> Iterator[Trace]:
        return iter(self.find())

    @overload
    def __getitem__(self, index: int) -> Trace: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Trace, ...]: ...
    def __getitem__(self, index: int | slice) -> Trace | tuple[Trace, ...]:
        return self.find()[index]
