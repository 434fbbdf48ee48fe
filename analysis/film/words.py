"""Writes words into pictures: bib, pulse and time, and why a frame is missing."""

import unicodedata
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final

import cv2
import numpy as np

from analysis.film.shots import UNKNOWN, Shot
from rig.api.language import Language
from rig.clocks import NS_PER_S
from rig.frame import FrameStatus
from rig.images.pixels import Stored

FONT: Final = cv2.FONT_HERSHEY_DUPLEX
_WHITE, _BLACK = (255, 255, 255), (0, 0, 0)
#: Height of the letters as a part of the picture's height, and limits, in units of the font (some 22 px).
_PART, _LEAST, _MOST = 1 / 18, 0.3, 2.0
_LETTER_PX: Final = 22
_BIB_MAX: Final = 20
_WORDS: Final[dict[Language, dict[str, str]]] = {
    Language.EN: {"bib": "bib", "pulse": "pulse"},
    Language.NB: {
        "bib": "startnr.", "pulse": "puls", UNKNOWN: "mangler", FrameStatus.LOST: "tapt",
        FrameStatus.MISSED: "ikke sett", FrameStatus.DAMAGED: "skadet", FrameStatus.ABSENT: "borte",
    },
}  # fmt: skip
#: Letters that have no accent that could be taken off.
_PLAIN: Final = str.maketrans({"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "ß": "ss", "ł": "l", "Ł": "L"})


def caption(shot: Shot, session: Mapping[str, str], language: Language) -> str:
    """Bib, pulse and time of day of a pulse; the font has no signs beyond ASCII."""
    words = _WORDS[language]
    bib = session.get("bib", "").strip()[:_BIB_MAX]
    plain = unicodedata.normalize("NFKD", bib.translate(_PLAIN)).encode("ascii", "ignore").decode()
    clock = datetime.fromtimestamp(shot.time // NS_PER_S, UTC).strftime("%H:%M:%S")
    thousandths = shot.time % NS_PER_S // 1_000_000
    whose = f"{words['bib']} {plain}  " if plain else ""
    return f"{whose}{words['pulse']} {shot.pulse}  {clock}.{thousandths:03d} UTC"


def write_caption(picture: Stored, text: str) -> None:
    """Write a line at the lower left, in place, as large as fits."""
    size = _size(picture, text)
    write_outlined(picture, text, (round(8 * size), picture.shape[0] - round(12 * size)), size)


def write_lacking(picture: Stored, shot: Shot, columns: tuple[tuple[int, int], ...], language: Language) -> None:
    """Write into each black block why there is no frame, in place."""
    for place, why in shot.lacking.items():
        word = _WORDS[language].get(why, why)
        block = picture[:, slice(*columns[place])]
        size = _size(block, word)
        (wide, high), _ = cv2.getTextSize(word, FONT, size, 1)
        write_outlined(block, word, ((block.shape[1] - wide) // 2, (block.shape[0] + high) // 2), size)


def _size(picture: Stored, text: str) -> float:
    """Size of the letters: a part of the height, smaller if the text would not fit."""
    size = min(max(picture.shape[0] * _PART / _LETTER_PX, _LEAST), _MOST)
    (wide, _), _ = cv2.getTextSize(text, FONT, size, 1)
    return float(min(size, size * 0.95 * picture.shape[1] / max(1, wide)))


def write_outlined(picture: Stored, text: str, at: tuple[int, int], size: float) -> None:
    """Write white words with a black edge into a grey or coloured picture, in place; `at`: where they begin, px."""
    if picture.dtype != np.uint8:  # OpenCV writes into pictures of eight bits only
        before = (picture >> 8).astype(np.uint8)
        after = before.copy()
        write_outlined(after, text, at, size)
        np.copyto(picture, after * np.uint16(257), where=after != before)
        return
    edge, thick = max(1, round(1.5 * size)), max(1, round(size))
    for dx in (-edge, 0, edge):  # a thicker pen would make the words longer
        for dy in (-edge, 0, edge):
            cv2.putText(picture, text, (at[0] + dx, at[1] + dy), FONT, size, _BLACK, thick, cv2.LINE_AA)
    cv2.putText(picture, text, at, FONT, size, _WHITE, thick, cv2.LINE_AA)
