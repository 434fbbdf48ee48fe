"""The patterns of printed targets: which corners belong to which code.

A coded target is a white square with a marker of OpenCV's ArUco dictionary in its middle and black fields at its four
sides. Each corner of the white square is a point where two black and two white fields meet; those corners are measured,
for they keep their place under blur. A ChArUco board is a grid of such targets that share corners. A target with
circles has a black disc about each of the four corners instead of the fields; its corners are the discs' centres.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from rig.arrays import Floats
from rig.errors import BadInputError

#: All targets are of one dictionary, so that no code is read as one of another.
DICTIONARY: Final = cv2.aruco.DICT_5X5_250
#: Codes from here on are single targets, those below are a board's.
FIRST_SINGLE: Final = 100
#: Single targets from here on have circles.
FIRST_CIRCLES: Final = 175
LAST_SINGLE: Final = 249
#: So many single targets there are of each kind.
MOST_SINGLE: Final = LAST_SINGLE - FIRST_CIRCLES + 1
#: Side of the marker in units of the white square's side.
MARKER: Final = 7.0 / 12.0
#: Fields along a marker's side, its black border included.
FIELDS: Final = 7
#: Depth of the black squares at a single target's sides, and half the side of what is cut out, in units of its side.
BAR: Final = 7.0 / 24.0
CUT: Final = 20.0 / 24.0
#: Radius of a disc in units of its target's side: the marker's corner is 2.4 radii from its centre, the cut 2.7.
DISC: Final = 1.0 / 8.0
#: Corners of a target in units of its side, in the order of OpenCV: clockwise from the top left; y points down.
CORNERS: Final[Floats] = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
_LETTERS: Final = "abcd"


@dataclass(frozen=True)
class Layout:
    """The targets that a person has printed.

    Attributes:
        columns, rows: squares of the board.
        board_mm: side of a square of the board.
        single_mm: side of the white square of a single target.
    """

    columns: int = 9
    rows: int = 6
    board_mm: float = 30.0
    single_mm: float = 80.0

    def __post_init__(self) -> None:
        """Refuse boards that have no inner corner or too many codes."""
        if min(self.columns, self.rows) < 3 or self.columns * self.rows // 2 > FIRST_SINGLE:
            raise BadInputError(
                f"a board of {self.columns} x {self.rows} squares: give it 3 x 3 squares at least and "
                f"{2 * FIRST_SINGLE} in all at most"
            )

    @cached_property
    def squares(self) -> dict[int, tuple[int, int]]:
        """Column and row of the white square of each of the board's codes, as OpenCV counts them."""
        white = [(x, y) for y in range(self.rows) for x in range(self.columns) if (x + y) % 2]
        return dict(enumerate(white))

    @property
    def codes(self) -> tuple[int, ...]:
        """The codes of all targets, those of the board first."""
        return (*self.squares, *range(FIRST_SINGLE, LAST_SINGLE + 1))

    def side_mm(self, code: int) -> float:
        """The side of a target's white square."""
        return self.board_mm if code < FIRST_SINGLE else self.single_mm

    def corners(self, code: int) -> tuple[str | None, str | None, str | None, str | None]:
        """The names of a target's corners, clockwise from the top left; None at the board's edge, where none is."""
        if code >= FIRST_SINGLE:
            one, two, three, four = (f"T{code}{letter}" for letter in _LETTERS)
            return one, two, three, four
        x, y = self.squares[code]
        return self._inner(x, y), self._inner(x + 1, y), self._inner(x + 1, y + 1), self._inner(x, y + 1)

    def _inner(self, x: int, y: int) -> str | None:
        return f"B{y}-{x}" if 0 < x < self.columns and 0 < y < self.rows else None

    def board_place(self, name: str) -> Floats | None:
        """Where a corner of the board should be, (3,) mm, y upwards; None for corners of single targets."""
        if not name.startswith("B"):
            return None
        y, x = (int(number) for number in name[1:].split("-"))
        return np.array([x * self.board_mm, -y * self.board_mm, 0.0])


def target_of(name: str) -> str:
    """The target that a corner belongs to: `T107` of `T107a`, `board` of `B2-3`."""
    return "board" if name.startswith("B") else name[:-1]


def has_circles(name: str) -> bool:
    """Whether the corner of this name is the centre of a disc."""
    return name.startswith("T") and int(name[1:-1]) >= FIRST_CIRCLES


def marker(code: int) -> NDArray[np.bool_]:
    """(7, 7) the fields of a marker, True where black."""
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARY)
    return np.asarray(cv2.aruco.generateImageMarker(dictionary, code, FIELDS) == 0)
