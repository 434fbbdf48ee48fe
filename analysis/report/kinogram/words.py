"""What a kinogram says, in English and Norwegian beside each other: who gets it has no setting for its language."""

from typing import Final

from analysis.report.figures import EARLY_S, FAR_M, decimals, fixed, plus_minus
from analysis.report.kinogram.figures import FEWEST, UNITS, Mark, Reference, Word
from analysis.report.kinogram.model import Kinogram
from analysis.report.kinogram.shots import Missing, Shot
from analysis.report.language import Said
from analysis.result.model import MeasuredRecording, Quantity

KMH: Final = 3.6  #: km/h in one m/s

_EARLY_NB: Final = f"{EARLY_S:g}".replace(".", ",")
TITLES: Final = {
    "takeoff_speed": Said("Take-off speed", "Fart på kanten"),
    "perpendicular": Said("Perpendicular to the table", "Vinkelrett på bordet"),
    "speed_20_m": Said(f"Speed at {FAR_M:g} m", f"Fart ved {FAR_M:g} m"),
    "angle_of_attack": Said(f"Angle of attack, {EARLY_S:g} s", f"Angrepsvinkel, {_EARLY_NB} s"),
    "ski_to_body": Said(f"Ski to body, {EARLY_S:g} s", f"Ski mot kropp, {_EARLY_NB} s"),
    "v_angle": Said(f"V angle of the skis, {EARLY_S:g} s", f"V-vinkel, {_EARLY_NB} s"),
    "height_20_m": Said(f"Height of the bindings at {FAR_M:g} m", f"Bindingenes høyde ved {FAR_M:g} m"),
}
MARKS: Final = {
    Word.BETTER: Said("better", "bedre"),
    Word.WORSE: Said("worse", "dårligere"),
    Word.HIGHER: Said("higher", "høyere"),
    Word.LOWER: Said("lower", "lavere"),
    Word.NOISE: Said("within noise", "innenfor støy"),
}
MISSING: Final = {
    Missing.NOT_MEASURED: Said("not measured here", "ikke målt her"),
    Missing.NO_PICTURE: Said("no picture of him here", "ikke noe bilde her"),
}
EDGE: Final = Said("Edge", "Kanten")
GOOD: Final = Said("Measured well", "Godt målt")
DOUBTFUL: Final = Said("Doubtful: do not rely on it", "Usikkert: ikke stol på det")
RIGHT: Final = Said("right ski", "høyre ski")
LEFT: Final = Said("left ski", "venstre ski")
BODY: Final = Said("helmet, hip, bindings", "hjelm, hofte, bindinger")
PREDICTED: Final = Said("not seen here: from the motion", "ikke sett her: fra bevegelsen")
METRE: Final = Said("same scale in all pictures", "samme målestokk i alle bildene")
NOT_MEASURED: Final = Said("not measured", "ikke målt")
NO_NAME: Final = Said("No name", "Uten navn")
BIB: Final = Said("bib", "startnr.")
GATE: Final = Said("gate", "bom")
WIND: Final = Said("wind", "vind")
RECORDING: Final = Said("recording", "opptak")
JUMP: Final = Said("jump", "hopp")
SIGMA: Final = Said(
    "± is one standard deviation. Heights are those of the survey.",
    "± er ett standardavvik. Høyder er landmålingens.",
)


def place_words(shot: Shot) -> Said:
    """What a place is called."""
    return EDGE if shot.place_m == 0 else Said(f"{shot.place_m:g} m", f"{shot.place_m:g} m")


def where_words(shot: Shot) -> str:
    """Where and when he really is in the picture, and whose picture it is; the same in both languages."""
    if shot.moment is None or shot.camera is None:
        return ""
    return f"{fixed(shot.moment.distance_m, 1)} m  {fixed(shot.moment.since_s, 2)} s  {shot.camera}"


def number_words(name: str, quantity: Quantity) -> list[str]:
    """A figure with its sigma as everywhere; a speed in km/h too, as on the jump's page."""
    lines = [plus_minus(quantity, UNITS[name])]
    if name in {"takeoff_speed", "speed_20_m"}:
        lines.append(f"{fixed(KMH * quantity.value, 1)} km/h")
    return lines


def mark_words(name: str, mark: Mark) -> Said:
    """The mark with the difference."""
    said = MARKS[mark.word]
    places = decimals(max(abs(mark.difference) / 2, 2e-3))
    places = min(places, 1) if UNITS[name] == "°" else places
    amount = fixed(mark.difference, places)
    amount = amount if mark.difference < 0 or not float(amount) else f"+{amount}"
    return Said(f"{said.english} {amount}", said.norwegian)


def reference_words(reference: Reference, *, ok: bool) -> Said:
    """What the marks compare with."""
    n = len(reference.jumps)
    if not ok:
        return Said("Not compared: the jump is doubtful.", "Ikke sammenlignet: hoppet er usikkert.")
    if not n:
        return Said("No earlier jumps to compare with.", "Ingen tidligere hopp å sammenligne med.")
    if n < FEWEST:
        return Said(f"Earlier jumps: {n}, too few to compare with.", f"Tidligere hopp: {n}, for få å sammenligne med.")
    if reference.by_speed:
        return Said(
            f"Marks: against the mean of the athlete's {n} fastest earlier jumps.",
            f"Merker: mot snittet av utøverens {n} raskeste tidligere hopp.",
        )
    return Said(
        f"Marks: against the mean of the athlete's {n} latest jumps.",
        f"Merker: mot snittet av utøverens {n} siste hopp.",
    )


def name_words(result: MeasuredRecording) -> Said:
    """Who jumped."""
    name = result.session.get("athlete", "").strip()
    return Said(name, name) if name else NO_NAME


def facts_words(kinogram: Kinogram, result: MeasuredRecording, hill: str) -> list[Said]:
    """Bib, number of the jump where there are several, date, hill, gate and wind, as far as they are known."""
    when = f"{kinogram.time.astimezone():%Y-%m-%d %H:%M}"
    number = kinogram.jump.number
    facts = [Said(f"{JUMP.english} {number}", f"{JUMP.norwegian} {number}")] if len(result.jumps) > 1 else []
    facts += [Said(text, text) for text in (when, hill) if text]
    for field, said in (("gate", GATE), ("wind", WIND)):
        if text := result.session.get(field, "").strip():
            facts.append(Said(f"{said.english} {text}", f"{said.norwegian} {text}"))
    bib = result.session.get("bib", "").strip()
    return ([Said(f"{BIB.english} {bib}", f"{BIB.norwegian} {bib}")] if bib else []) + facts
