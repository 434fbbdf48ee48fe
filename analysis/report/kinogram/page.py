"""`kinogram.html`: the kinogram as one page, which needs nothing from elsewhere, no script, and prints on one sheet."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from html import escape
from typing import Final

import cv2

from analysis.report.coach import lone_page
from analysis.report.frames import Grey
from analysis.report.kinogram import words
from analysis.report.kinogram.drawing import DARK, LIGHT, RADII, WIDTHS, dots_of, lines_of
from analysis.report.kinogram.figures import Mark, Word
from analysis.report.kinogram.model import Kinogram
from analysis.report.kinogram.shots import HEIGHT, WIDTH, Shot
from analysis.report.language import Said, reasons, same
from analysis.report.overlay import COLOURS, Colour, Overlay
from analysis.result.model import MeasuredRecording, Quantity

#: Bytes that all pictures of a page may need; the whole page stays below 600 kB.
PICTURE_BUDGET: Final = 500_000
_QUALITIES: Final = (85, 75, 60, 45, 30, 15)
_KEY: Final = (("right", words.RIGHT), ("left", words.LEFT), ("body", words.BODY))


def page_text(kinograms: Sequence[Kinogram], result: MeasuredRecording, hill: str) -> str:
    """The page.

    Args:
        kinograms: of the jumps of a recording.
        result: the recording.
        hill: name of the rig.
    """
    pictures = iter(_addresses([s.picture for k in kinograms for s in k.shots if s.picture is not None]))
    parts = [_jump(kinogram, pictures, result, hill) for kinogram in kinograms]
    foot = f"<footer><p>{_both(words.SIGMA)}</p><p>{_both(words.RECORDING)} {escape(result.recording)}</p></footer>"
    title = f"{words.name_words(result).english}: kinogram"
    return lone_page(same(title), f"<main>{''.join(parts)}</main>{foot}", "kinogram/kinogram.css")


def _jump(kinogram: Kinogram, pictures: Iterator[str], result: MeasuredRecording, hill: str) -> str:
    facts = words.facts_words(kinogram, result, hill)
    head = f"<header><h1>{_both(words.name_words(result))}</h1><p>{' &ensp; '.join(map(_both, facts))}</p></header>"
    shots = "".join(_shot(shot, pictures) for shot in kinogram.shots)
    figures = "".join(_figure(name, own, kinogram.marks.get(name)) for name, own in kinogram.figures.items())
    compared = _both(words.reference_words(kinogram.reference, ok=kinogram.jump.verdict.ok))
    return (
        f'<section>{head}<div class="shots">{shots}{_key(kinogram)}</div><dl>{figures}</dl><p>{compared}</p></section>'
    )


def _shot(shot: Shot, pictures: Iterator[str]) -> str:
    place, where = _both(words.place_words(shot)), escape(words.where_words(shot))
    label = f'<figcaption><b>{place}</b><span class="where">{where}</span>'
    if shot.picture is None or shot.overlay is None:
        why = "" if shot.missing is None else _both(words.MISSING[shot.missing])
        return f'<figure>{label}</figcaption><p class="missing">{why}</p></figure>'
    alt = (
        f"the jumper at {words.place_words(shot).english.lower()}, seen by camera {shot.camera}, with his stick figure"
    )
    box = f'viewBox="-0.5 -0.5 {WIDTH} {HEIGHT}"'
    return (
        f'<figure>{label}</figcaption><svg {box} role="img" aria-label="{escape(alt)}">'
        f'<image x="-0.5" y="-0.5" width="{WIDTH}" height="{HEIGHT}" href="{next(pictures)}"/>'
        f"{_stick(shot.overlay)}</svg></figure>"
    )


def _stick(overlay: Overlay) -> str:
    """The stick figure as `drawing.draw` draws it."""
    lines, dots, parts = list(lines_of(overlay)), list(dots_of(overlay)), []
    for step, edge in enumerate((LIGHT, DARK, None)):
        for line in lines:
            places = " ".join(f"{x:.1f},{y:.1f}" for x, y in line.places)
            colour = _hex(edge or COLOURS[line.part])
            parts.append(f'<polyline points="{places}" stroke="{colour}" stroke-width="{WIDTHS[step]}"/>')
        for dot in dots:
            colour = _hex(edge or (COLOURS[dot.part] if dot.seen else DARK))
            ring = "" if dot.seen or edge else f' stroke="{_hex(COLOURS[dot.part])}" stroke-width="2"'
            radius = RADII[step] * dot.size
            parts.append(f'<circle cx="{dot.x:.1f}" cy="{dot.y:.1f}" r="{radius:.1f}" fill="{colour}"{ring}/>')
    return f'<g fill="none" stroke-linecap="round" stroke-linejoin="round">{"".join(parts)}</g>'


def _key(kinogram: Kinogram) -> str:
    """Verdict and key in the place of a sixth picture."""
    ok, scale = kinogram.jump.verdict.ok, next((s.px_per_m for s in kinogram.shots if s.px_per_m is not None), None)
    lines = "".join(
        f'<li><svg viewBox="0 0 64 12" aria-hidden="true"><path d="M6 6h52" stroke="{_hex(DARK)}" stroke-width="8"/>'
        f'<path d="M6 6h52" stroke="{_hex(COLOURS[part])}" stroke-width="4"/></svg><p>{_both(said)}</p></li>'
        for part, said in _KEY
    )
    ring = (
        f'<li><svg viewBox="0 0 64 20" aria-hidden="true"><circle cx="32" cy="10" r="9" fill="{_hex(DARK)}"/>'
        f'<circle cx="32" cy="10" r="5" fill="none" stroke="{_hex(COLOURS["body"])}" stroke-width="2"/></svg>'
        f"<p>{_both(words.PREDICTED)}</p></li>"
    )
    metre = ""
    if scale is not None:  # as wide beside the pictures as a metre is in them
        bar = f'<path d="M2 2v16M2 10h{scale:.0f}m0-8v16" stroke="currentColor" stroke-width="3"/>'
        metre = f'<svg class="metre" viewBox="-16 0 {WIDTH} 20" aria-hidden="true">{bar}</svg>'
        metre += f"<p><b>1 m</b> {_both(words.METRE)}</p>"
    kind, said = ("good", words.GOOD) if ok else ("bad", words.DOUBTFUL)
    why = _both(reasons(kinogram.jump.verdict))
    verdict = f'<div class="verdict {kind}"><strong>{_both(said)}</strong><p>{why}</p></div>'
    return f'<div class="key">{verdict}<ul>{lines}{ring}</ul>{metre}</div>'


def _figure(name: str, quantity: Quantity | None, mark: Mark | None) -> str:
    number, more = f'<span class="none">{_both(words.NOT_MEASURED)}</span>', ""
    if quantity is not None:
        first, *rest = words.number_words(name, quantity)
        number = f"<b>{escape(first)}</b>" + "".join(f"<span>{escape(line)}</span>" for line in rest)
    if mark is not None:
        kind = {Word.BETTER: "good", Word.WORSE: "bad", Word.NOISE: "noise"}.get(mark.word, "other")
        more = f'<dd class="mark {kind}">{_both(words.mark_words(name, mark))}</dd>'
    return f"<div><dt>{_both(words.TITLES[name])}</dt><dd>{number}</dd>{more}</div>"


def _both(said: Said) -> str:
    """Words in both languages; once where they are the same."""
    if said.english == said.norwegian:
        return escape(said.english)
    return f'<span>{escape(said.english)}</span> <span class="other" lang="nb">{escape(said.norwegian)}</span>'


def _addresses(pictures: Sequence[Grey]) -> list[str]:
    """Pictures as `data:` addresses, in the best quality that the budget allows."""
    encoded: list[bytes] = []
    for quality in _QUALITIES:
        encoded = [cv2.imencode(".webp", one, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes() for one in pictures]
        if sum(map(len, encoded)) * 4 / 3 <= PICTURE_BUDGET:
            break
    return ["data:image/webp;base64," + b64encode(data).decode("ascii") for data in encoded]


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour)
