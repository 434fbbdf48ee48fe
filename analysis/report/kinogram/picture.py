"""The kinogram as one JPEG of a phone's width, to be sent."""

from typing import Final

import cv2
import numpy as np

from analysis.report.kinogram import words
from analysis.report.kinogram.drawing import DARK, LIGHT, Picture, draw
from analysis.report.kinogram.figures import Word
from analysis.report.kinogram.model import Kinogram
from analysis.report.kinogram.shots import HEIGHT, WIDTH, Shot
from analysis.report.language import Said
from analysis.report.overlay import COLOURS, Colour
from analysis.result.model import MeasuredRecording

_GAP: Final = 16
_ACROSS: Final = 2 * WIDTH + 3 * _GAP
_HEAD, _FIGURE, _FOOT = 116, 164, 62
_QUALITY: Final = 88
_WIDEST_METRE: Final = 220  # px; a longer one leaves no room for the words beside it
_REGULAR, _BOLD = 450, 750  # weights of letters
_GROUND: Final[Colour] = (238, 242, 247)
_CARD: Final[Colour] = (255, 255, 255)
_INK: Final[Colour] = (16, 26, 38)
_SOFT: Final[Colour] = (74, 90, 109)
_GREEN: Final[Colour] = (17, 121, 58)
_RED: Final[Colour] = (179, 19, 30)
_MARKS: Final[dict[Word, tuple[Colour, Colour]]] = {
    Word.BETTER: (_GREEN, LIGHT),
    Word.WORSE: (_RED, LIGHT),
    Word.HIGHER: ((23, 103, 196), LIGHT),
    Word.LOWER: ((23, 103, 196), LIGHT),
    Word.NOISE: ((222, 229, 237), _INK),
}


def jpeg_of(kinogram: Kinogram, result: MeasuredRecording, hill: str) -> bytes:
    """The picture.

    Args:
        kinogram: of a jump.
        result: the recording that it belongs to.
        hill: name of the rig.
    """
    sheet = _Sheet(_HEAD + 3 * (HEIGHT + _GAP) + 4 * (_FIGURE + _GAP) + _FOOT)
    _head(sheet, kinogram, result, hill)
    cells = [(_GAP + column * (WIDTH + _GAP), _HEAD + row * (HEIGHT + _GAP)) for row in range(3) for column in range(2)]
    for shot, cell in zip(kinogram.shots, cells[:5], strict=True):
        _picture(sheet, shot, cell)
    _key(sheet, kinogram, cells[5])
    top = _HEAD + 3 * (HEIGHT + _GAP)
    for order, name in enumerate(kinogram.figures):
        _figure(sheet, kinogram, name, (_GAP + order % 2 * (WIDTH + _GAP), top + order // 2 * (_FIGURE + _GAP)))
    _notes(sheet, kinogram, (2 * _GAP + WIDTH, top + 3 * (_FIGURE + _GAP)))
    sheet.write(result.recording, (_GAP + 4, len(sheet.pixels) - 22), 20, colour=_SOFT, most=_ACROSS - 3 * _GAP)
    _, data = cv2.imencode(".jpg", sheet.pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return data.tobytes()


class _Sheet:
    """The picture in the making; places are (x, y), of words their beginning on the line."""

    def __init__(self, height: int) -> None:
        self.pixels: Picture = np.full((height, _ACROSS, 3), _GROUND, np.uint8)
        self._font = cv2.FontFace("sans")

    def box(self, at: tuple[int, int], size: tuple[int, int], colour: Colour) -> None:
        """A filled rectangle."""
        self.pixels[at[1] : at[1] + size[1], at[0] : at[0] + size[0]] = colour

    def width(self, text: str, size: int, weight: int = _REGULAR) -> int:
        """Of a line of words, px."""
        return int(cv2.getTextSize((0, 0), text, (0, 0), self._font, size, weight)[2])

    def write(
        self, text: str, at: tuple[int, int], size: int, weight: int = _REGULAR, *, colour: Colour = _INK, most: int
    ) -> int:
        """A line of words, smaller where it would be wider than `most`; returns where it ends."""
        while size > 8 and self.width(text, size, weight) > most:
            size -= 1
        end, _ = cv2.putText(self.pixels, text, at, colour, self._font, size, weight, wrap=(0, 1 << 20))
        return int(end[0])

    def paragraph(self, text: str, at: tuple[int, int], size: int, *, colour: Colour, most: int) -> int:
        """Words on as many lines as they need; returns where the next line would be."""
        line, (x, y) = "", at
        for word in text.split():
            longer = f"{line} {word}".strip()
            if line and self.width(longer, size) > most:
                self.write(line, (x, y), size, colour=colour, most=most)
                line, y = word, y + round(size * 1.35)
            else:
                line = longer
        self.write(line, (x, y), size, colour=colour, most=most)
        return y + round(size * 1.35)


def _head(sheet: _Sheet, kinogram: Kinogram, result: MeasuredRecording, hill: str) -> None:
    name = words.name_words(result)
    who = name.english if name.english == name.norwegian else f"{name.english} · {name.norwegian}"
    sheet.write(who, (_GAP + 4, 56), 46, _BOLD, most=_ACROSS - 3 * _GAP)
    line = "   ".join(_both(fact) for fact in words.facts_words(kinogram, result, hill))
    sheet.write(line, (_GAP + 4, 94), 24, colour=_SOFT, most=_ACROSS - 3 * _GAP)


def _picture(sheet: _Sheet, shot: Shot, at: tuple[int, int]) -> None:
    x, y = at
    if shot.picture is None or shot.overlay is None or shot.missing is not None:
        sheet.box(at, (WIDTH, HEIGHT), (211, 220, 230))
        if shot.missing is not None:
            said = words.MISSING[shot.missing]
            sheet.write(said.english, (x + 24, y + HEIGHT // 2), 28, colour=_SOFT, most=WIDTH - 48)
            sheet.write(said.norwegian, (x + 24, y + HEIGHT // 2 + 34), 22, colour=_SOFT, most=WIDTH - 48)
    else:
        part = np.ascontiguousarray(np.broadcast_to(shot.picture[:, :, np.newaxis], (HEIGHT, WIDTH, 3)))
        draw(part, shot.overlay)
        sheet.pixels[y : y + HEIGHT, x : x + WIDTH] = part
    label = _both(words.place_words(shot))
    sheet.box(at, (sheet.width(label, 34, _BOLD) + 28, 52), _INK)
    sheet.write(label, (x + 14, y + 38), 34, _BOLD, colour=LIGHT, most=WIDTH)
    if where := words.where_words(shot):
        wide = sheet.width(where, 20) + 20
        sheet.box((x + WIDTH - wide, y + HEIGHT - 32), (wide, 32), _INK)
        sheet.write(where, (x + WIDTH - wide + 10, y + HEIGHT - 10), 20, colour=LIGHT, most=WIDTH)


def _key(sheet: _Sheet, kinogram: Kinogram, at: tuple[int, int]) -> None:
    """Verdict and key in the place of a sixth picture."""
    x, y = at
    ok = kinogram.jump.verdict.ok
    sheet.box(at, (WIDTH, HEIGHT), _CARD)
    sheet.box(at, (WIDTH, 92), _GREEN if ok else _RED)
    said = words.GOOD if ok else words.DOUBTFUL
    sheet.write(said.english, (x + 20, y + 42), 32, _BOLD, colour=LIGHT, most=WIDTH - 40)
    sheet.write(said.norwegian, (x + 20, y + 76), 25, colour=LIGHT, most=WIDTH - 40)
    y += 124
    for part, named in (("right", words.RIGHT), ("left", words.LEFT), ("body", words.BODY)):
        cv2.line(sheet.pixels, (x + 20, y), (x + 84, y), DARK, 8, cv2.LINE_AA)
        cv2.line(sheet.pixels, (x + 20, y), (x + 84, y), COLOURS[part], 4, cv2.LINE_AA)
        y = _key_words(sheet, named, (x, y))
    cv2.circle(sheet.pixels, (x + 52, y), 9, DARK, -1, cv2.LINE_AA)
    cv2.circle(sheet.pixels, (x + 52, y), 6, COLOURS["body"], 2, cv2.LINE_AA)
    y = _key_words(sheet, words.PREDICTED, (x, y))
    scale = next((shot.px_per_m for shot in kinogram.shots if shot.px_per_m is not None), None)
    if scale is not None:
        length = 1.0 if scale < _WIDEST_METRE else 0.5
        metre = round(length * scale)
        cv2.line(sheet.pixels, (x + 20, y), (x + 20 + metre, y), _INK, 3)
        for end in (x + 20, x + 20 + metre):
            cv2.line(sheet.pixels, (end, y - 8), (end, y + 8), _INK, 3)
        beside = sheet.write(f"{length:g} m", (x + 30 + metre, y + 2), 20, _BOLD, most=60) + 14
        sheet.write(words.METRE.english, (beside, y - 2), 18, most=x + WIDTH - 12 - beside)
        sheet.write(words.METRE.norwegian, (beside, y + 20), 16, colour=_SOFT, most=x + WIDTH - 12 - beside)


def _key_words(sheet: _Sheet, said: Said, at: tuple[int, int]) -> int:
    x, y = at
    sheet.write(said.english, (x + 104, y + 1), 21, most=WIDTH - 116)
    sheet.write(said.norwegian, (x + 104, y + 23), 17, colour=_SOFT, most=WIDTH - 116)
    return y + 56


def _figure(sheet: _Sheet, kinogram: Kinogram, name: str, at: tuple[int, int]) -> None:
    x, y = at
    sheet.box(at, (WIDTH, _FIGURE), _CARD)
    title, quantity, mark = words.TITLES[name], kinogram.figures[name], kinogram.marks.get(name)
    sheet.write(title.english, (x + 18, y + 30), 23, 600, most=WIDTH - 36)
    sheet.write(title.norwegian, (x + 18, y + 53), 18, colour=_SOFT, most=WIDTH - 36)
    if quantity is None:
        sheet.write(_both(words.NOT_MEASURED), (x + 18, y + 98), 24, colour=_SOFT, most=WIDTH - 36)
        return
    wide = 0
    if mark is not None:
        said, (ground, ink) = words.mark_words(name, mark), _MARKS[mark.word]
        wide = max(sheet.width(said.english, 21, 650), sheet.width(said.norwegian, 18)) + 28
        left = x + WIDTH - 16 - wide
        sheet.box((left, y + 98), (wide, 58), ground)
        sheet.write(said.english, (left + 14, y + 123), 21, 650, colour=ink, most=wide - 28)
        sheet.write(said.norwegian, (left + 14, y + 146), 18, colour=ink, most=wide - 28)
    for line, down, size, weight in zip(
        words.number_words(name, quantity), (92, 132), (34, 25), (_BOLD, _REGULAR), strict=False
    ):
        beside = wide if down > 92 else 0
        sheet.write(line, (x + 18, y + down), size, weight, most=WIDTH - 46 - beside)


def _notes(sheet: _Sheet, kinogram: Kinogram, at: tuple[int, int]) -> None:
    x, y = at[0] + 18, at[1] + 36
    reference = words.reference_words(kinogram.reference, ok=kinogram.jump.verdict.ok)
    for said in (reference, words.SIGMA):
        y = sheet.paragraph(said.english, (x, y), 18, colour=_INK, most=WIDTH - 36)
        y = sheet.paragraph(said.norwegian, (x, y), 16, colour=_SOFT, most=WIDTH - 36) + 4


def _both(said: Said) -> str:
    return said.english if said.english == said.norwegian else f"{said.english} · {said.norwegian}"
