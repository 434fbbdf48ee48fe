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
from analysis.report.language import LANGUAGES, Language, Said, attribute, reasons, shown
from analysis.report.overlay import ELLIPSE_SIGMAS, SKI_LENGTH_M, Overlay
from analysis.report.scrubbing import READOUT, frames_json, still_svg
from analysis.result.model import Jump
from photogrammetry.reports.document import Drawing

_STILLS: Final = 5
_NO_PICTURE: Final = Said("no picture of the jumper", "ikke noe bilde av hopperen")
_TURNS: Final = (
    ("0,0", Said("side", "side")), ("0,90", Said("above", "over")), ("90,0", Said("behind", "bak")),
)  # fmt: skip


def _comma(value: float) -> str:
    return f"{value:g}".replace(".", ",")


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


def jump_section(of: JumpShown, *, several: bool) -> str:
    """The part of the page; `several`: there are other jumps."""
    jump = of.jump
    hidden = "" if several else ' class="unseen"'
    title = shown(Said(f"Jump {jump.number}", f"Hopp {jump.number}"))
    parts = [f"<h2{hidden}>{title}</h2>", _verdict(jump), _five(of.figures)]
    if of.course.pulses:
        over, length = Said("Over the distance", "Over avstanden"), f"{SKI_LENGTH_M:g}"
        words = Said(
            f"The stick model at evenly distributed pulses. Skis are drawn {length} m long, with the binding in their "
            "middle.",
            f"Strekfiguren ved jevnt fordelte pulser. Skiene er tegnet {length.replace('.', ',')} m lange, med "
            "bindingen midt på.",
        )
        parts.append(_scrubber(of))
        parts += [_charts(over, bands(of.course, language), _band_words(of.course), language) for language in LANGUAGES]
        flight = Said("The flight", "Svevet")
        parts += [_charts(flight, fig8(of.course, language), words, language, wide=True) for language in LANGUAGES]
        parts.append(_stills(of))
    return f'<section class="jump" id="jump-{jump.number}">{"".join(parts)}</section>'


def _verdict(jump: Jump) -> str:
    kind, mark, words = (
        ("good", "\N{CHECK MARK}", Said("You can rely on these numbers", "Du kan stole på disse tallene"))
        if jump.verdict.ok
        else ("bad", "!", Said("Do not rely on these numbers", "Ikke stol på disse tallene"))
    )
    told = reasons(jump.verdict)
    both = "".join(
        f'<div lang="{language}"><strong>{words.of(language)}</strong><p>{escape(told.of(language))}</p></div>'
        for language in LANGUAGES
    )
    return f'<div class="verdict {kind}"><span aria-hidden="true">{mark}</span>{both}</div>'


def _five(figures: Sequence[Figure]) -> str:
    return f'<dl class="five">{"".join(_figure(figure) for figure in figures)}</dl>'


def _figure(figure: Figure) -> str:
    number = f'<span class="value none">{shown(Said("not measured", "ikke målt"))}</span>'
    if figure.quantity is not None:
        value, sigma = value_and_sigma(figure.quantity, figure.unit)
        degree, unit = ("°", "") if figure.unit == "°" else ("", f' <span class="unit">{escape(figure.unit)}</span>')
        number = f'<span class="value">{value}{degree}</span> <span class="sigma">± {sigma}{degree}</span>{unit}'
    return (
        f'<div><dt>{shown(Said(figure.title, figure.title_nb))}</dt><dd class="number">{number}</dd>'
        f'<dd class="note">{shown(Said(figure.note, figure.note_nb))}</dd></div>'
    )


def _scrubber(of: JumpShown) -> str:
    course = of.course
    frames = frames_json(course, of.pulses, of.cameras, of.overlays, of.crops)
    start = int(np.argmin([abs(float(course.since[i]) - EARLY_S) for i in of.pulses]))
    data = json.dumps(frames, separators=(",", ":"), allow_nan=False, ensure_ascii=False).replace("<", "\\u003c")
    views = "".join(_view(name, i) for i, name in enumerate(of.cameras))
    rows = "".join(
        f'<tr><th scope="row">{shown(words)}</th><td data-number="{i}"></td></tr>'
        for i, (_, words, _) in enumerate(READOUT)
    )
    title = Said("Frame by frame", "Bilde for bilde")
    lines = Said("draw lines and points over the pictures", "tegn linjer og punkter over bildene")
    pulse = Said("pulse", "puls")
    back, on = Said("one pulse back", "en puls tilbake"), Said("one pulse on", "en puls fram")
    return f"""<section class="scrubber" data-start="{start}" {attribute("aria-label", title)}>
<h3>{shown(title)}</h3>
<div class="views">{views}{_stick()}</div>
<div class="controls">
<button type="button" class="back" {attribute("aria-label", back)}>&#9664;&#xFE0E;</button>
<button type="button" class="play">Play</button>
<button type="button" class="on" {attribute("aria-label", on)}>&#9654;&#xFE0E;</button>
<output></output>
<input type="range" min="0" max="{len(frames) - 1}" value="{start}" step="1" {attribute("aria-label", pulse)}>
</div>
<label class="lines"><input type="checkbox" checked> {shown(lines)}</label>
<table class="numbers"><tbody>{rows}</tbody></table>
<div class="note">{shown(_SCRUBBING, "p")}</div>
<script type="application/json">{data}</script>
</section>"""


_SCRUBBING: Final = Said(
    "Lines: stick model projected into the image; crosses and dots: measured there, crosses that "
    "are turned: not used, the protocol says why; ellipses: "
    f"{ELLIPSE_SIGMAS:g} times the standard deviation, dashed where nothing was measured. Time and distance count "
    f"from the take-off. Numbers in italics: a point is uncertain by more than {LARGEST_SIGMA_M * 10:g} dm. Tap a view "
    "to enlarge it. Arrow keys step, space plays in slow motion.",
    f"Linjer: strekfiguren tegnet inn i bildet; kryss og prikker: målt der, kryss på skrå: ikke "
    f"brukt, protokollen sier hvorfor; ellipser: {_comma(ELLIPSE_SIGMAS)} ganger "
    "standardavviket, stiplet der ingenting ble målt. Tid og avstand regnes fra satsen. Tall i kursiv: et punkt er "
    f"mer usikkert enn {_comma(LARGEST_SIGMA_M * 10)} dm. Trykk på et bilde for å gjøre det stort. Piltastene går ett "
    "steg, mellomrom spiller i sakte film.",
)


def _stick() -> str:
    buttons = "".join(f'<button type="button" data-turn="{turn}">{shown(words)}</button>' for turn, words in _TURNS)
    label = attribute("aria-label", Said("stick figure", "strekfigur"))
    return (
        f'<figure class="stick"><div class="picture"><svg viewBox="0 0 320 240" role="img" {label}></svg></div>'
        f"<figcaption>{buttons}</figcaption></figure>"
    )


def _view(name: str, index: int) -> str:
    words = attribute("alt", Said(f"the jumper seen by camera {name}", f"hopperen sett av kamera {name}"))
    box = f"0 0 {CROP_WIDTH} {CROP_HEIGHT}"
    return (
        f'<figure class="view" data-view="{index}"><div class="picture">'
        f'<img {words} width="{CROP_WIDTH}" height="{CROP_HEIGHT}">'
        f'<svg viewBox="{box}" aria-hidden="true"></svg><p hidden>{shown(_NO_PICTURE)}</p></div>'
        f"<figcaption>{escape(name)}</figcaption></figure>"
    )


def _band_words(course: Course) -> Said:
    en = [
        f"Bands: value ± {BAND_SIGMAS:g} standard deviations, from the model over time; dots: each pulse alone.",
        f"Grey: a point of the jumper is uncertain by more than {LARGEST_SIGMA_M * 10:g} dm.",
    ]
    nb = [
        f"Bånd: verdien ± {_comma(BAND_SIGMAS)} standardavvik, av modellen over tid; prikker: hver puls for seg.",
        f"Grått: et punkt på hopperen er mer usikkert enn {_comma(LARGEST_SIGMA_M * 10)} dm.",
    ]
    if course.takeoff_sigma_s is not None:
        ms = fixed(course.takeoff_sigma_s * 1000, 1)
        en.append(f"The time of take-off is known to ± {ms} ms.")
        nb.append(f"Tiden for satsen er kjent på ± {ms.replace('.', ',')} ms.")
    return Said(" ".join(en), " ".join(nb))


def _charts(title: Said, drawings: Sequence[Drawing], words: Said, language: Language, *, wide: bool = False) -> str:
    if not drawings:
        return ""
    figures = "".join(
        f"<figure>{drawing.svg}<figcaption>{escape(drawing.caption)}</figcaption></figure>" for drawing in drawings
    )
    kind = "charts wide" if wide else "charts"
    return (
        f'<div lang="{language}"><h3>{escape(title.of(language))}</h3>'
        f'<p class="note">{escape(words.of(language))}</p><div class="{kind}">{figures}</div></div>'
    )


def _stills(of: JumpShown) -> str:
    """Pictures for paper, and for browsers without scripts."""
    rows = []
    for i in evenly(of.course, _STILLS, of.pulses):
        pulse = int(of.course.pulses[i].pulse)
        pictures = [
            f"<p>{escape(name)}: {shown(_NO_PICTURE)}</p>"
            if (crop := of.crops.get((pulse, name))) is None
            else still_svg(of.overlays[pulse][name], crop, Said(f"camera {name}", f"kamera {name}"))
            for name in of.cameras
        ]
        if any((pulse, name) in of.crops for name in of.cameras):
            when = f"{fixed(float(of.course.since[i]), 2)} s"
            words = Said(f"{when}, pulse {pulse}", f"{when.replace('.', ',')}, puls {pulse}")
            rows.append(f"<figure><div>{''.join(pictures)}</div><figcaption>{shown(words)}</figcaption></figure>")
    title = shown(Said("Pictures", "Bilder"))
    return f'<div class="stills"><h3>{title}</h3>{"".join(rows)}</div>' if rows else ""
