"""`report.html`: one page for the coach, which needs nothing from elsewhere."""

import base64
import hashlib
from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Final

from analysis.measurements.model import Measurements
from analysis.report.course import course_of
from analysis.report.crops import crops_of, windows_of
from analysis.report.figures import five_figures
from analysis.report.jump_section import JumpShown, jump_section
from analysis.report.language import LANGUAGES, Said, attribute, day_of, said, same, shown
from analysis.report.scrubbing import overlays_of, shown_pulses
from analysis.result.model import MeasuredRecording, Quantity
from analysis.scene.camera_system import CameraSystem
from rig.clocks import NS_PER_S
from rig.errors import BadInputError

#: Bytes that all pictures of a page may need; the whole page stays below 8 MB.
PICTURE_BUDGET: Final = 6_000_000
#: Pulses that can be scrubbed, in all jumps of a page together.
_MOST_FRAMES: Final = 120
_FEWEST_FRAMES: Final = 12
_NOTES: Final = (
    Said(
        "± is one standard deviation: two of three such numbers are closer than that to the truth, 95 of 100 closer "
        "than twice that. It carries the errors of the measurement in the images, of the orientation of the cameras "
        "and of the survey.",
        "± er ett standardavvik: to av tre slike tall ligger nærmere sannheten enn det, 95 av 100 nærmere enn det "
        "dobbelte. Det har med seg feilene i målingen i bildene, i orienteringen av kameraene og i innmålingen.",
    ),
    Said(
        "Angle of attack: slope of the skis minus the slope of the path. No wind is assumed: head wind and up-draught "
        "make the true angle to the air larger.",
        "Angrepsvinkel: skienes helning minus banens helning. Det regnes uten vind: motvind og oppvind gjør den sanne "
        "vinkelen mot luften større.",
    ),
    Said(
        "The posture in early flight correlates with the length of the jump most at 1.1 s after take-off (Virmavirta "
        "and others, 2005), some 28 m from the edge: that is beyond the 20 m filmed here.",
        "Stillingen tidlig i svevet henger mest sammen med hopplengden 1,1 s etter satsen (Virmavirta m.fl., 2005), "
        "rundt 28 m fra hoppkanten: det er lenger ute enn de 20 m som filmes her.",
    ),
    Said(
        "Speed, height and distance are those of O, the middle between the two bindings, not of the centre of mass.",
        "Fart, høyde og avstand gjelder O, midt mellom de to bindingene, ikke tyngdepunktet.",
    ),
)
_MORE: Final = Said(
    "How the cameras were oriented, and the test of every ray: protocol.html.",
    "Hvordan kameraene ble orientert, og testen av hver stråle: protocol.html.",
)
#: Fields of a session that are not on the page, which is sent on and opened by the link to a jump: what was noted about
#: the athlete, by whom, and how the recording is found again.
_UNSAID: Final = frozenset({"athlete", "recording", "notes", "operator", "tags", "favourite"})
#: How the fields of notes at single pulses begin.
_NOTE: Final = "note."
#: Fields of a session as a coach calls them.
_FIELDS: Final = {
    "bib": Said("bib", "startnummer"),
    "gate": Said("gate", "bom"),
    "wind": Said("wind", "vind"),
    "club": Said("club", "klubb"),
    "round": Said("round", "omgang"),
    "session": Said("session", "økt"),
}


def write_report(
    result: MeasuredRecording,
    measurements: Measurements,
    system: CameraSystem,
    log: Path,
    out: Path,
    *,
    perpendicular: Mapping[int, Quantity] | None = None,
) -> None:
    """Write the coach's page.

    Args:
        result: what was measured.
        measurements: what was measured in the images of its jumps.
        system: the oriented cameras.
        log: where the images are.
        out: the page, overwritten if it exists.
        perpendicular: by number of the jump its velocity perpendicular to the table, m/s, up is positive.

    Raises:
        BadInputError: the log cannot be read, or `out` cannot be written.
    """
    page = report_page(result, measurements, system, log, perpendicular or {})
    try:
        out.write_text(page, encoding="utf-8")
    except OSError as error:
        raise BadInputError(f"{out}: cannot be written ({error.strerror}); choose another place") from None


def report_page(
    result: MeasuredRecording,
    measurements: Measurements,
    system: CameraSystem,
    log: Path,
    perpendicular: Mapping[int, Quantity],
) -> str:
    """The page; see `write_report`."""
    measured = {jump.number: jump for jump in measurements.jumps}
    share = max(1, len(result.jumps))
    most = max(_FEWEST_FRAMES, _MOST_FRAMES // share)
    parts = []
    for jump in result.jumps:
        course = course_of(jump, result.rate_hz)
        pulses = shown_pulses(course, most)
        overlays = overlays_of(course, pulses, measured.get(jump.number), system)
        crops = crops_of(log, windows_of(overlays, system), PICTURE_BUDGET // share)
        figures = five_figures(course, perpendicular.get(jump.number))
        of_jump = JumpShown(jump, course, pulses, overlays, crops, system.names, figures)
        parts.append(jump_section(of_jump, several=len(result.jumps) > 1))
    nothing = Said("There is no jump in this recording.", "Det er ikke noe hopp i dette opptaket.")
    main = "\n".join(parts) or shown(nothing, "p")
    body = f"{_head(result)}\n<main>{_alarms(result)}{main}</main>\n{_notes(result)}"
    return lone_page(_title(result), body, "report.css", "report.js")


def lone_page(title: Said, body: str, style_name: str, script_name: str | None = None) -> str:
    """A page that needs nothing from elsewhere, and may load nothing.

    Args:
        title: of the page, plain text.
        body: of the page, HTML.
        style_name: name of its style sheet below this folder.
        script_name: likewise of its script; None: it has none.
    """
    style, script = _resource(style_name), "" if script_name is None else _resource(script_name)
    scripts = f"'{_hash(script)}'" if script else "'none'"
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src {scripts}; "
        "base-uri 'none'; form-action 'none'"
    )
    head = (
        f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f'<title data-en="{escape(title.english)}" data-nb="{escape(title.norwegian)}">{escape(title.english)}</title>'
        f"<style>{style}</style>"
    )
    whole = f"{body}\n<script>{script}</script>" if script else body
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n{whole}</body></html>\n'


def _resource(name: str) -> str:
    return files("analysis.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _title(result: MeasuredRecording) -> Said:
    athlete = result.session.get("athlete", "").strip()
    return same(athlete) if athlete else _recording(result)


def _recording(result: MeasuredRecording) -> Said:
    return Said(f"Recording {result.recording}", f"Opptak {result.recording}")


def _head(result: MeasuredRecording) -> str:
    facts = [
        Said(f"{name.english} {value}", f"{name.norwegian} {value}")
        for key, value in result.session.items()
        if key not in _UNSAID and not key.startswith(_NOTE) and value.strip() and (name := _FIELDS.get(key, same(key)))
    ]
    times = [pulse.time for jump in result.jumps for pulse in jump.pulses[:1]]
    if times:
        then = datetime.fromtimestamp(min(times) // NS_PER_S, UTC)
        facts.append(Said(*(f"{day}, {then:%H:%M:%S} UTC" for day in day_of(then))))
    recording = _recording(result)
    facts.append(Said(recording.english.replace("R", "r", 1), recording.norwegian.replace("O", "o", 1)))
    items = "".join(f"<li>{shown(fact)}</li>" for fact in facts)
    choice = "".join(
        f'<button type="button" data-language="{language}">{name}</button>'
        for language, name in zip(LANGUAGES, ("English", "Norsk"), strict=True)
    )
    languages = (
        f'<div class="languages" role="group" {attribute("aria-label", Said("Language", "Språk"))}>{choice}</div>'
    )
    return f'<header>{languages}<h1>{shown(_title(result))}</h1><ul class="facts">{items}</ul></header>'


def _alarms(result: MeasuredRecording) -> str:
    """What is wrong with the whole recording."""
    lines = [move.said for move in result.orientation.moved]
    lines += [offset.said for offset in result.synchrony.values() if offset.said is not None]
    attention = Said("Attention:", "Obs:")
    return "".join(
        f'<p class="alarm" lang="{language}"><strong>{attention.of(language)}</strong> '
        f"{escape(said(line).of(language))}</p>"
        for line in lines
        for language in LANGUAGES
    )


def _notes(result: MeasuredRecording) -> str:
    rate = f"{result.rate_hz:g}"
    pulses = Said(
        f"Measured at {rate} pulses per second. {_MORE.english}",
        f"Målt med {rate.replace('.', ',')} pulser i sekundet. {_MORE.norwegian}",
    )
    items = "".join(f"<li>{shown(line)}</li>" for line in (*_NOTES, pulses))
    return f"<footer><h2>{shown(Said('What the numbers mean', 'Hva tallene betyr'))}</h2><ul>{items}</ul></footer>"
