"""What films have in common, whatever they are: frames by number, which come one after the other."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.pixels import Stored


@dataclass(frozen=True, slots=True)
class Taken:
    """One frame of a film.

    Attributes:
        number: of the frame in its film.
        pixels: uint8 or uint16, (rows, columns); None: there are none.
        status: `OK`; `DAMAGED`: it cannot be read; `LOST`: its number is there and it is not.
        why: what is wrong, in words; empty if nothing is.
    """

    number: int
    pixels: Stored | None
    status: FrameStatus = FrameStatus.OK
    why: str = ""


class Film(Protocol):
    """A film of one camera; it is never in memory as a whole."""

    @property
    def path(self) -> Path:
        """The folder or file."""
        ...

    @property
    def kind(self) -> str:
        """What it is, in a few words."""
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its frames, px."""
        ...

    @property
    def bits(self) -> int:
        """Significant bits of its grey values: 8, or more than that and at most 16."""
        ...

    @property
    def first(self) -> int:
        """Number of its first frame."""
        ...

    @property
    def expected(self) -> int | None:
        """How many frames it says that it has; None: it does not say."""
        ...

    @property
    def date(self) -> UtcNs | None:
        """When it was begun, UTC, as the file itself says; None: it does not say."""
        ...

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of it, one line each; more of them when its frames have been read."""
        ...

    def frames(self, first: int) -> Iterator[Taken]:
        """Read the frames, in order.

        Args:
            first: number of the first one that is wanted.

        Raises:
            BadInputError: a frame is not as the others are, or there is none of that number.
        """
        ...


def single_gaps(frames: Iterator[Taken]) -> Iterator[Taken]:
    """Pass frames on as long as no two damaged ones follow each other: then the film itself is broken.

    Raises:
        BadInputError: two frames in a row cannot be read, those apart that are lost.
    """
    before: Taken | None = None
    for each in frames:
        if each.status is FrameStatus.LOST:
            yield each
            continue
        damaged = each.status is FrameStatus.DAMAGED
        if damaged and before is not None:
            raise BadInputError(
                f"{before.why}, and the frame after it too: {each.why}; write them again, or remove them"
            )
        yield each
        before = each if damaged else None
