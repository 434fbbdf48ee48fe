"""The part of the coach's page that shows one jump."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np

from analysis.report.charts import BAND_SIGMAS, bands, evenly, fig8
from analysis.report.course import LARGEST_SIGMA_M, Course
from analysis.report.crops import CROP_HEIGHT, CROP_WIDTH, Crop
from analysis.report.figures import EARLY_S, Figure, fixed, value_and_sigma
from analysis.report.overlay import ELLIPSE_SIGMAS, SKI_LENGTH_M, Overlay
from analysis.report.scrubbing import READOUT, frames_json, still_svg
from analysis.result.model import Jump
from photogrammetry.reports.document import Drawing

_STILLS: Final = 5
_NO_PICTURE: Final = "no picture of the jumper"
_STICK = """<figure class="stick"><div class="picture">
<svg viewBox="0 0 320 240" role="img" aria-label="stick figure"></svg></div><figcaption>\
<button type="button" data-turn="0,0">side</button><button type="button" data-turn="0,90">above</button>\
<button type="button" data-turn="90,0">behind</button></figcaption></figure>"""


@dataclass(frozen=True, slots=True, eq=False)
class JumpShown:
    """A jump with everything that its part of the page shows.

    Attributes:
        jump: the jump.
        course: of it.
        pulses: indices of those that can be scrubbed.
        overlays: by pulse and camera.
        crops: by pulse and camera.
        cameras: in the order of the log.
        figures: the five numbers.
    """

    jump: Jump
    course: Course
    pulses: Sequence[int]
    overlays: Mapping[int, Mapping[str, Overlay]]
    crops: Mapping[tuple[int, str], Crop]
    cameras: tuple[str, ...]
    figures: tuple[Figure, ...]


def jump_section(shown: JumpShown, *, several: bool) -> str:
    """The part of the page; `several`: there are other jumps."""
    jump = shown.jump
    hidden = "" if several else ' class="unseen"'
    parts = [f"<h2{hidden}>Jump {jump.number}</h2>", _verdict(jump), _five(shown.figures)]
    if shown.course.pulses:
        parts += [_scrubber(shown), _charts("Over the distance", bands(shown.course), _band_words(shown.course))]
        words = (
            f"The stick model at evenly distributed pulses. Skis are drawn {SKI_LENGTH_M:g} m long, with the binding "
            "in their middle."
        )
        parts += [_charts("The flight", fig8(shown.course), words, wide=True), _stills(shown)]
    return f'<section class="jump" id="jump-{jump.number}">{"".join(parts)}</section>'


def _verdict(jump: Jump) -> str:
    kind, mark, words = (
        ("good", "\N{CHECK MARK}", "You can rely on these numbers")
        if jump.verdict.ok
        else ("bad", "!", "Do not rely on these numbers")
    )
    return (
        f'<div class="verdict {kind}"><span aria-hidden="true">{mark}</span>'
        f"<div><strong>{words}</strong><p>{escape(jump.verdict.message)}</p></div></div>"
    )


def _five(figures: Sequence[Figure]) -> str:
    return f'<dl class="five">{"".join(_figure(figure) for figure in figures)}</dl>'


def _figure(figure: Figure) -> str:
    number = '<span class="value none">not measured</span>'
    if figure.quantity is not None:
        value, sigma = value_and_sigma(figure.quantity)
        degree, unit = ("°", "") if figure.unit == "°" else ("", f' <span class="unit">{escape(figure.unit)}</span>')
        number = f'<span class="value">{value}{degree}</span> <span class="sigma">± {sigma}{degree}</span>{unit}'
    return (
        f'<div><dt>{escape(figure.title)}</dt><dd class="number">{number}</dd>'
        f'<dd class="note">{escape(figure.note)}</dd></div>'
    )


def _scrubber(shown: JumpShown) -> str:
    course = shown.course
    frames = frames_json(course, shown.pulses, shown.cameras, shown.overlays, shown.crops)
    start = int(np.argmin([abs(float(course.since[i]) - EARLY_S) for i in shown.pulses]))
    data = json.dumps(frames, separators=(",", ":"), allow_nan=False, ensure_ascii=False).replace("<", "\\u003c")
    views = "".join(_view(name, i) for i, name in enumerate(shown.cameras))
    rows = "".join(
        f'<tr><th scope="row">{escape(words)}</th><td data-number="{i}"></td></tr>'
        for i, (_, words, _) in enumerate(READOUT)
    )
    return f"""<section class="scrubber" data-start="{start}" aria-label="Frame by frame">
<h3>Frame by frame</h3>
<div class="views">{views}{_STICK}</div>
<div class="controls">
<button type="button" class="back" aria-label="one pulse back">&#9664;&#xFE0E;</button>
<button type="button" class="play">Play</button>
<button type="button" class="on" aria-label="one pulse on">&#9654;&#xFE0E;</button>
<output></output>
<input type="range" min="0" max="{len(frames) - 1}" value="{start}" step="1" aria-label="pulse">
</div>
<label class="lines"><input type="checkbox" checked> draw lines and points over the pictures</label>
<table class="numbers"><tbody>{rows}</tbody></table>
<p class="note">Lines: stick model projected into the image; crosses and dots: measured there; ellipses:
{ELLIPSE_SIGMAS:g} times the standard deviation, dashed where nothing was measured. Time and distance count from the
take-off. Numbers in italics: a point is uncertain by more than {LARGEST_SIGMA_M * 10:g} dm. Tap a view to enlarge it.
Arrow keys step, space plays in slow motion.</p>
<script type="application/json">{data}</script>
</section>"""


def _view(name: str, index: int) -> str:
    words = f"the jumper seen by camera {escape(name)}"
    box = f"0 0 {CROP_WIDTH} {CROP_HEIGHT}"
    return (
        f'<figure class="view" data-view="{index}"><div class="picture">'
        f'<img alt="{words}" width="{CROP_WIDTH}" height="{CROP_HEIGHT}">'
        f'<svg viewBox="{box}" aria-hidden="true"></svg><p hidden>{_NO_PICTURE}</p></div>'
        f"<figcaption>{escape(name)}</figcaption></figure>"
    )


def _band_words(course: Course) -> str:
    words = [
        f"Bands: value ± {BAND_SIGMAS:g} standard deviations, from the model over time; dots: each pulse alone.",
        f"Grey: a point of the jumper is uncertain by more than {LARGEST_SIGMA_M * 10:g} dm.",
    ]
    if course.takeoff_sigma_s is not None:
        words.append(f"The time of take-off is known to ± {fixed(course.takeoff_sigma_s * 1000, 1)} ms.")
    return " ".join(words)


def _charts(title: str, drawings: Sequence[Drawing], words: str, *, wide: bool = False) -> str:
    if not drawings:
        return ""
    figures = "".join(
        f"<figure>{drawing.svg}<figcaption>{escape(drawing.caption)}</figcaption></figure>" for drawing in drawings
    )
    kind = "charts wide" if wide else "charts"
    return f'<h3>{escape(title)}</h3><p class="note">{escape(words)}</p><div class="{kind}">{figures}</div>'


def _stills(shown: JumpShown) -> str:
    """Pictures for paper, and for browsers without scripts."""
    rows = []
    for i in evenly(shown.course, _STILLS, shown.pulses):
        pulse = int(shown.course.pulses[i].pulse)
        pictures = [
            f"<p>{escape(name)}: {_NO_PICTURE}</p>"
            if (crop := shown.crops.get((pulse, name))) is None
            else still_svg(shown.overlays[pulse][name], crop, escape(f"camera {name}"))
            for name in shown.cameras
        ]
        if any((pulse, name) in shown.crops for name in shown.cameras):
            when = f"{fixed(float(shown.course.since[i]), 2)} s, pulse {pulse}"
            rows.append(f"<figure><div>{''.join(pictures)}</div><figcaption>{when}</figcaption></figure>")
    return f'<div class="stills"><h3>Pictures</h3>{"".join(rows)}</div>' if rows else ""
