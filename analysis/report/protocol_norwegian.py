# ruff: noqa: E501 - a text stands beside its translation
"""The protocol in Norwegian: the English one, sentence by sentence; what has no translation stays English."""

import re
from collections.abc import Iterator, Mapping
from typing import Final

from analysis.report.language import reasons, said
from analysis.result.model import MeasuredRecording
from photogrammetry.reports.document import Drawing, Report, Section, Table

_WELL: Final = "measured well: "
#: English and Norwegian; `{name}` is anything, which is translated in its turn, and `{_name}` anything that is not.
_SENTENCES: Final = (
    ("Protocol of recording {_name}", "Protokoll for opptak {_name}"),
    ("Network of balls: {title}", "Nettet av baller: {title}"),
    ("Jump {n}: verdict", "Hopp {n}: vurdering"),
    ("Jump {n}: what was measured", "Hopp {n}: hva som ble målt"),
    ("Jump {n}: tests of rays, the worst first", "Hopp {n}: tester av stråler, de verste først"),
    ("Jump {n}: what is missing, and why", "Hopp {n}: hva som mangler, og hvorfor"),
    ("there is no jump in this recording", "det er ikke noe hopp i dette opptaket"),
    ("recording {_name}, {rate} pulses per second, {count} jumps", "opptak {_name}, {rate} pulser i sekundet, antall hopp: {count}"),
    ("lengths m, sigmas of lengths mm, angles and their sigmas degrees; sigmas are standard deviations and hold in the frame of the survey", "lengder i m, sigma for lengder i mm, vinkler og deres sigma i grader; sigma er standardavvik og gjelder i innmålingens system"),
    ("source: {_name}; {count} uncertain parameters with one joint covariance", "kilde: {_name}; {count} usikre parametere med felles kovarians"),
    ("s right, s up, s axis: sigma of the turns about the camera's own axes", "s høyre, s opp, s akse: sigma for dreininger om kameraets egne akser"),
    ("moved: {what} (p = {p})", "flyttet: {what} (p = {p})"),
    ("no camera moved", "ingen kameraer er flyttet"),
    ("measured in the images, px:", "målt i bildene, px:"),
    ("not tested", "ikke testet"),
    ("how much later than the others each camera shows the jumper, from the jumper himself:", "hvor mye senere enn de andre hvert kamera viser hopperen, funnet av hopperen selv:"),
    ("reliable: {what}", "pålitelig: {what}"), ("not reliable: {what}", "ikke pålitelig: {what}"),
    ("the take-off was not in sight", "satsen var ikke i sikte"),
    ("take-off at pulse {pulse} ± {sigma} (± {ms} ms)", "sats ved puls {pulse} ± {sigma} (± {ms} ms)"),
    ("raw: solution of each pulse alone; columns count pulses by status of the point or ski", "rå: løsning av hver puls alene; kolonnene teller pulser etter status for punktet eller skien"),
    ("mean sigma of points, mm, from each pulse alone and from the model over time:", "midlere sigma for punkter, mm, fra hver puls alene og fra modellen over tid:"),
    ("measured in the images, by camera:", "målt i bildene, per kamera:"),
    ("no ray is controlled by others", "ingen stråle er kontrollert av andre"),
    ("{count} rays and image lines tested, {above} of them with |w| > 2 ({share}; 4.6 % are expected); {free} are controlled by nothing", "{count} stråler og bildelinjer testet, {above} av dem med |w| > 2 ({share}; 4.6 % er ventet); {free} er ikke kontrollert av noe"),
    ("{count} rays or image lines were left out as gross errors:", "{count} stråler eller bildelinjer ble tatt ut som grove feil:"),
    ("{what}: no raw solution at {pulses}: {why}", "{what}: ingen rå løsning ved {pulses}: {why}"),
    ("within the pictures of fewer than two cameras", "i bildene til færre enn to kameraer"),
    ("measured in fewer than two images", "målt i færre enn to bilder"),
    ("its rays or planes coincide within their accuracy", "strålene eller planene faller sammen innenfor nøyaktigheten"),
    ("its images contradict each other, and no single one is found to be wrong", "bildene motsier hverandre, og det er ikke funnet at ett av dem er feil"),
    ("too few images control it, and the motion of the whole jump contradicts it", "for få bilder kontrollerer det, og bevegelsen i hele hoppet motsier det"),
    ("measured, but it may be something else on the jumper", "målt, men det kan være noe annet på hopperen"),
    ("What became of each point and ski. Thick: green has a raw solution, grey was not found in two images, red was refused. Thin, {_cameras} in this order: green is used, amber is left out by the model over time, red contradicts the other images, blue is measured but without solution, grey is not found. Empty: out of sight, or no frame.", "Hva som skjedde med hvert punkt og hver ski. Tykk: grønt har en rå løsning, grått er ikke funnet i to bilder, rødt er forkastet. Tynn, {_cameras} i denne rekkefølgen: grønt er brukt, gult er utelatt av modellen over tid, rødt motsier de andre bildene, blått er målt men uten løsning, grått er ikke funnet. Tomt: ute av sikte, eller uten bilde."),
    ("{what}: two rays, not controllable, at {pulses}", "{what}: to stråler, kan ikke kontrolleres, ved {pulses}"),
    ("no values from the model over time at {pulses}", "ingen verdier fra modellen over tid ved {pulses}"),
    ("pulses {which}", "puls {which}"),
    # what a person should know of the orientation, as the panel's page says it
    ("camera {c}: {named} of {expected} surveyed balls in sight named, {measured} balls measured, {spots} round spots found", "kamera {c}: {named} av {expected} innmålte baller i sikte har fått navn, {measured} baller målt, {spots} runde flekker funnet"),
    ("surveyed balls found in no image: {_balls}", "innmålte baller som ikke finnes i noe bilde: {_balls}"),
    ("the images show a ball at {ball} + ({off}) {unit} and none at its surveyed coordinates; survey it again", "bildene viser en ball ved {ball} + ({off}) {unit} og ingen ved de innmålte koordinatene; mål den inn på nytt"),
    ("camera {c}: light comes from the side: the balls look {share} times as large as they are; their centres are measured with this light", "kamera {c}: lyset kommer fra siden: ballene ser {share} ganger så store ut som de er; midtpunktene er målt med dette lyset"),
    ("camera {c}: not seen as whole balls in the light of the others, so they count little: {_balls}", "kamera {c}: ikke sett som hele baller i samme lys som de andre, så de teller lite: {_balls}"),
    ("camera {c}: seen only where its pose says that they are: {_balls}", "kamera {c}: bare sett der plasseringen sier at de er: {_balls}"),
    ('the radius of the balls is not given; {radius} m fits the images best; measure it and give it as "ball_radius_m" in the survey: a wrong radius moves all balls of an image alike', 'radien til ballene er ikke oppgitt; {radius} m passer best til bildene; mål den og oppgi den som "ball_radius_m" i innmålingen: en feil radius flytter alle ballene i et bilde likt'),
    ("camera {c} is not oriented: {why}", "kamera {c} er ikke orientert: {why}"),
    ("camera {c} of the survey has no image in the log", "kamera {c} i innmålingen har ikke noe bilde i loggen"),
    ("the residuals are {ratio} times as large as their sigmas say (image points, by camera: {cameras}); the sigmas of the result are larger by as much; check the interior orientations and the sigmas of the survey", "restfeilene er {ratio} ganger så store som sigmaene deres sier (bildepunkter, per kamera: {cameras}); sigmaene i resultatet er like mye større; sjekk de indre orienteringene og sigmaene i innmålingen"),
    ("{count} places of the helmet tie the images beside the balls", "{count} steder for hjelmen binder bildene sammen ved siden av ballene"),
    ("cannot be read from the log, which is damaged: {pulses}; svev verify says more", "kan ikke leses fra loggen, som er skadet: {pulses}; svev verify sier mer"),
    ("{what}: wrong by about ({size}) {unit}; measure it again", "{what}: feil med omtrent ({size}) {unit}; mål på nytt"),
    ("{what}: wrong by about ({size}) {unit} (w = {w}); measure it again", "{what}: feil med omtrent ({size}) {unit} (w = {w}); mål på nytt"),
    ("point {point} is left out: {why}", "punkt {point} er utelatt: {why}"),
    ("taken out: {what}", "tatt ut: {what}"), ("suspected: {what}", "mistenkt: {what}"),
    # the adjustment of the balls
    ("Stage 1: free adjustment", "Trinn 1: fri utjevning"),
    ("Stage 2: similarity transformation onto the reference points", "Trinn 2: likedannethetstransformasjon til referansepunktene"),
    ("Stage 3: constrained adjustment", "Trinn 3: tvangsutjevning"),
    ("alternative 1: {count} moving points left out, static points tie the images alone", "alternativ 1: {count} bevegelige punkter utelatt, faste punkter alene binder bildene sammen"),
    ("alternative 2: no moving point ties the images beside the static ones", "alternativ 2: ingen bevegelige punkter binder bildene sammen ved siden av de faste"),
    ("alternative 2: {count} moving points tie the images beside the static ones", "alternativ 2: {count} bevegelige punkter binder bildene sammen ved siden av de faste"),
    ("left out: {why}", "utelatt: {why}"),
    ("there is no free block", "det finnes ingen fri blokk"),
    ("no gross error found", "ingen grove feil funnet"),
    ("{n} observations, redundancy {r}, sigma0 {s} (a priori {a})", "{n} observasjoner, redundans {r}, sigma0 {s} (a priori {a})"),
    ("{n} reference points, redundancy {r}, residuals rms X Y Z {xyz}, sigma0 {s} (a priori {a})", "{n} referansepunkter, redundans {r}, restfeil rms X Y Z {xyz}, sigma0 {s} (a priori {a})"),
    ("converged after {n} iterations", "konvergerte etter {n} iterasjoner"),
    ("{n} observations - {u} unknowns = redundancy {r}; {i} images, {p} points", "{n} observasjoner - {u} ukjente = redundans {r}; {i} bilder, {p} punkter"),
    ("{n} observations - {u} unknowns + {d} datum conditions = redundancy {r}; {i} images, {p} points", "{n} observasjoner - {u} ukjente + {d} datumbetingelser = redundans {r}; {i} bilder, {p} punkter"),
    ("sigma0 {s} (a priori {a}): {words}", "sigma0 {s} (a priori {a}): {words}"),
    ("the observations agree with their sigmas (by chance {low} to {high} times the a priori)", "observasjonene stemmer med sine sigma (ved tilfeldighet {low} til {high} ganger a priori)"),
    ("the observations are {times} times more accurate than their sigmas say, which is not chance", "observasjonene er {times} ganger mer nøyaktige enn deres sigma sier, og det er ikke tilfeldig"),
    ("the observations are {times} times less accurate than their sigmas say, which is not chance (up to {high}); check sigmas, interior orientations and the largest residuals", "observasjonene er {times} ganger mindre nøyaktige enn deres sigma sier, og det er ikke tilfeldig (opptil {high}); sjekk sigma, indre orienteringer og de største restfeilene"),
    ("nothing is redundant, so nothing is tested", "ingenting er overbestemt, så ingenting testes"),
    ("points: sigma {s} (median), worst {w} at {_where}", "punkter: sigma {s} (median), dårligst {w} ved {_where}"),
    ("positions: sigma {s} (median), worst {w} at image {_where}", "posisjoner: sigma {s} (median), dårligst {w} ved bilde {_where}"),
    ("estimated accuracy of the observations: {parts}", "estimert nøyaktighet for observasjonene: {parts}"),
    ("{group} {factor} x a priori (redundancy {r})", "{group} {factor} x a priori (redundans {r})"),
    ("{group} {size} (redundancy {r})", "{group} {size} (redundans {r})"),
    ("no gross error is suspected", "ingen grove feil mistenkes"),
    ("no single observation explains the residuals", "ingen enkelt observasjon forklarer restfeilene"),
    ("suspected gross errors ({n}), the first is the suspect:", "mistenkte grove feil ({n}), den første er den mistenkte:"),
    ("taken out ({n}):", "tatt ut ({n}):"),
    ("and {n} more in the result file", "og {n} til i resultatfilen"),
    ("sigma0 a priori {s}; {weights}", "sigma0 a priori {s}; {weights}"),
    ("weights (sigma0 / sigma)^2 as given", "vekter (sigma0 / sigma)^2 som oppgitt"),
    ("weights estimated from the residuals, group by group, from these sigmas on", "vekter estimert fra restfeilene, gruppe for gruppe, med disse sigma som start"),
    ("interior orientations held as they are given, free of error: {_cameras}", "indre orienteringer holdt som oppgitt, feilfrie: {_cameras}"),
    ("interior orientation held as it is given, although the file estimates it: {_cameras}", "indre orientering holdt som oppgitt, selv om filen estimerer den: {_cameras}"),
    ("points: {counts}", "punkter: {counts}"), ("{n} control", "{n} kontroll"), ("{n} tie", "{n} sammenbinding"), ("{n} check", "{n} sjekk"), ("{n} fixed", "{n} faste"),
    ("datum: control points, distances and differences", "datum: kontrollpunkter, avstander og differanser"),
    ("risk of the global test {a}, that anything is suspected in sound data {b}", "risiko for den globale testen {a}, for at noe mistenkes i feilfrie data {b}"),
    ("all sigmas below are a posteriori: they carry the estimated sigma0", "alle sigma nedenfor er a posteriori: de har med den estimerte sigma0"),
    ("few observations are redundant; the a-priori variance counts as four more: they carry {a} instead of {b}", "få observasjoner er overtallige; a priori-variansen teller som fire til: de har med {a} i stedet for {b}"),
    ("agrees: {words}", "stemmer: {words}"), ("smaller: {words}", "mindre: {words}"), ("larger: {words}", "større: {words}"), ("untested: {words}", "ikke testet: {words}"),
    ("Lengths in {u}, metric frame (x right, y up, origin at the image centre).", "Lengder i {u}, metrisk system (x til høyre, y opp, origo i bildets midtpunkt)."),
    ("The distortion acts on the side: {_cameras}.", "Fortegningen virker på siden (projected: avbildet, observed: målt): {_cameras}."),
    ("Projection centres, {u}:", "Projeksjonssentre, {u}:"),
    ("Degrees: R = R_X(omega) R_Y(phi) R_Z(kappa); sigma 1, 2, 3 are of turns about the camera's own axes:", "Grader: R = R_X(omega) R_Y(phi) R_Z(kappa); sigma 1, 2, 3 gjelder dreininger om kameraets egne akser:"),
    ("Rotations R; the columns are the camera's axes in the object system:", "Rotasjoner R; kolonnene er kameraets akser i objektsystemet:"),
    ("angle: the nearest to a right angle at which two rays of the point meet, degrees", "vinkel: den av punktets skjæringsvinkler mellom to stråler som er nærmest en rett, grader"),
    ("Root mean squares, {u}:", "Kvadratiske middelverdier, {u}:"),
    ("sigma of {role} points", "sigma for punkter: {role}"), ("sigma of projection centres", "sigma for projeksjonssentre"),
    ("residuals of control points", "restfeil i kontrollpunkter"), ("check points, adjusted - given", "sjekkpunkter, utjevnet - gitt"),
    ("area: convex hull of the points over the image; reach: radius of the outermost point over the half diagonal", "areal: punktenes konvekse omhylning over bildet; rekkevidde: radien til det ytterste punktet over den halve diagonalen"),
    ("{n} among interior orientation and pose reach {r}:", "{n} mellom indre orientering og plassering når {r}:"),
    ("{n} among interior orientation and pose reach {r}; the strongest:", "{n} mellom indre orientering og plassering når {r}; de sterkeste:"),
    ("None of interior orientation and poses reaches {r}.", "Ingen mellom indre orientering og plassering når {r}."),
    ("finds: the smallest error that its test finds in four of five cases at a risk of 0.1 % (internal reliability)", "finner: den minste feilen som testen finner i fire av fem tilfeller med risiko 0.1 % (indre pålitelighet)"),
    ("moves: the largest shift of a point or projection centre by an error of that size (external reliability)", "flytter: den største forskyvningen av et punkt eller projeksjonssenter ved en slik feil (ytre pålitelighet)"),
    ("image {_name}, {u}", "bilde {_name}, {u}"), ("control points, {u}", "kontrollpunkter, {u}"), ("distances, {u}", "avstander, {u}"), ("differences, {u}", "differanser, {u}"),
    ("surveyed {axis}", "innmålt {axis}"), ("image points", "bildepunkter"), ("accepted at {risk}", "godtas ved {risk}"), ("{low} to {high}", "{low} til {high}"), ("moves ({u})", "flytter ({u})"),
    ("Images ({u}):", "Bilder ({u}):"), ("Image {_name}:", "Bilde {_name}:"), ("camera {_name}", "kamera {_name}"),
    ("Survey, adjusted - given, {u}:", "Innmåling, utjevnet - gitt, {u}:"),
    ("Distances, differences, weighted parameters:", "Avstander, differanser, vektede parametere:"),
    ("Normalized residuals w: {a} of {b} beyond {limit}, {c} expected. What is beyond 5 stands in the last bar.", "Normaliserte restfeil w: {a} av {b} utenfor {limit}, {c} ventet. Det som er utenfor 5, står i den siste søylen."),
    ("Redundancy numbers of the image coordinates, from {a} to {b}. Near 0 nothing checks an observation; near 1 its whole error shows.", "Redundanstall for bildekoordinatene, fra {a} til {b}. Nær 0 kontrollerer ingenting en observasjon; nær 1 vises hele feilen."),
    ("Image {_name}: {n} residuals, the bar is their scale; rms {rms}.", "Bilde {_name}: {n} restfeil, streken er målestokken; rms {rms}."),
    ("Image {_name}: {n} residuals{beyond}, the bar is their scale; rms {rms}.", "Bilde {_name}: {n} restfeil{beyond}, streken er målestokken; rms {rms}."),
    ("Camera {_name}: mean residual in each of {n} cells, the bar is their scale. Neighbours that point the same way are what the lens model leaves out.", "Kamera {_name}: midlere restfeil i hver av {n} ruter, streken er målestokken. Naboer som peker samme vei, er det linsemodellen utelater."),
    ("Camera {_name}: residuals (adjusted - observed) outwards from the principal point, against the radius. A mean that leaves zero is distortion left over; the largest is {size}.", "Kamera {_name}: restfeil (utjevnet - målt) utover fra hovedpunktet, mot radien. Et middel som forlater null, er gjenværende fortegning; det største er {size}."),
    (", {n} beyond |w| = {limit} (red)", ", {n} utenfor |w| = {limit} (røde)"),
    ("{words} from above: one-sigma ellipses (red) {n} times as large as they are.", "{words} ovenfra: en-sigma-ellipser (røde) {n} ganger så store som de er."),
    ("{words} from the side: one-sigma ellipses (red) {n} times as large as they are.", "{words} fra siden: en-sigma-ellipser (røde) {n} ganger så store som de er."),
)  # fmt: skip
_WORDS: Final = {
    "Recording": "Opptak", "Orientation of the cameras": "Orientering av kameraene", "Balls": "Baller",
    "Synchrony": "Samtidighet", "Jumps": "Hopp", "Procedure": "Framgangsmåte", "Summary": "Sammendrag",
    "Assumed a priori": "Forutsatt a priori", "Global test": "Global test", "Network": "Nett",
    "Interior orientation": "Indre orientering", "Poses": "Plasseringer", "Points": "Punkter",
    "Image coverage": "Bildedekning", "Correlations": "Korrelasjoner", "Reliability": "Pålitelighet",
    "Residuals": "Restfeil", "Network (cameras green, surveyed points blue)": "Nett (kameraer grønne, innmålte punkter blå)",
    "camera": "kamera", "s right": "s høyre", "s up": "s opp", "s axis": "s akse", "ball": "ball", "role": "rolle",
    "images": "bilder", "image": "bilde", "offset (ms)": "forskyvning (ms)", "sigma (ms)": "sigma (ms)",
    "offset / sigma": "forskyvning / sigma", "finding": "funn", "synchronous": "samtidig", "phase": "fase",
    "pulses": "pulser", "pulse": "puls", "points": "punkter", "points_controlled": "kontrollerte punkter", "skis": "ski",
    "solved": "løst", "controlled": "kontrollert", "median_sigma_m": "median sigma (m)", "coarse": "grove",
    "chi2_by_dof": "chi2 / frihetsgrader", "gross_errors": "grove feil",
    "table": "før kanten", "edge": "ved kanten", "flight": "svev", "what": "hva", "two rays": "to stråler",
    "predicted": "predikert", "by hand": "for hånd", "missing": "mangler", "raw X": "rå X", "raw Y": "rå Y",
    "raw Z": "rå Z", "smoothed X": "glattet X", "smoothed Y": "glattet Y", "smoothed Z": "glattet Z",
    "right": "høyre", "left": "venstre", "residual (px)": "restfeil (px)", "removed": "tatt ut",
    "control": "kontroll", "tie": "sammenbinding", "check": "sjekk", "fixed": "fast", "none": "ingen",
    "point": "punkt", "observed": "observert", "count": "antall", "smallest sigma": "minste sigma",
    "largest sigma": "største sigma", "unit": "enhet", "ratio": "forhold", "redundancy": "redundans",
    "chance": "tilfeldighet", "parameter": "parameter", "value": "verdi", "how": "hvordan", "held": "holdt",
    "estimated": "estimert", "significant": "signifikant", "yes": "ja", "no": "nei", "axis": "akse", "rays": "stråler",
    "angle": "vinkel", "of": "for", "all": "alle", "area": "areal", "reach": "rekkevidde", "one": "den ene",
    "other": "den andre", "median finds": "finner, median", "largest finds": "finner, størst",
    "not controlled": "ikke kontrollert", "by": "ved", "mean r": "midlere r", "largest |w|": "største |w|",
    "use": "bruk", "taken out": "tatt ut", "left aside": "satt til side", "observation": "observasjon",
}  # fmt: skip


def norwegian(report: Report, result: MeasuredRecording) -> Report:
    """The protocol in Norwegian, part by part.

    Args:
        report: the English one.
        result: what it is of, whose findings and verdicts exist in both languages.
    """
    known = dict(_known(result))

    def part(one: str | Table | Drawing) -> str | Table | Drawing:
        if isinstance(one, str):
            return _said(one, known)
        if isinstance(one, Drawing):
            return Drawing(_said(one.caption, known), one.svg, one.text)
        rows = tuple(tuple(_said(cell, known) for cell in row) for row in one.rows)
        return Table(tuple(_said(cell, known) for cell in one.head), rows)

    sections = (Section(_said(each.title, known), tuple(map(part, each.parts))) for each in report.sections)
    return Report(_said(report.title, known), tuple(sections))


def _known(result: MeasuredRecording) -> Iterator[tuple[str, str]]:
    """Sentences of the analysis, by their English text."""
    for jump in result.jumps:
        well = "godt målt: " if jump.verdict.message.startswith(_WELL) else ""
        if jump.verdict.said:
            yield jump.verdict.message, well + reasons(jump.verdict).norwegian
    for finding in (*(move.said for move in result.orientation.moved), *(o.said for o in result.synchrony.values())):
        if finding is not None:
            yield finding.text, said(finding).norwegian


def _said(text: str, known: Mapping[str, str]) -> str:
    if (found := known.get(text, _WORDS.get(text))) is not None:
        return found
    for pattern, template in _PATTERNS:
        if (match := pattern.fullmatch(text)) is not None:
            return template.format(
                **{name: each if name[0] == "_" else _said(each, known) for name, each in match.groupdict().items()}
            )
    for between in ("; ", ", "):
        if between in text:
            return between.join(_said(each, known) for each in text.split(between))
    return text


def _pattern(template: str) -> re.Pattern[str]:
    def place(name: re.Match[str]) -> str:
        return f"(?P<{name[1]}>{'[^;]' if name[1][0] == '_' else '.'}+?)"

    return re.compile(re.sub(r"\\\{(\w+)\\\}", place, re.escape(template)))


#: Those with the most words of their own first.
_PATTERNS: Final = [
    (_pattern(one), other) for one, other in sorted(_SENTENCES, key=lambda pair: -len(re.sub(r"\{\w+\}", "", pair[0])))
]
