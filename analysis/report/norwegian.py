"""Norwegian of what the analysis says, by code: the sentences of the panel's page (a test compares them)."""

from typing import Final

#: Templates, filled in with the values of a `Phrase`.
SENTENCES: Final = {
    "sentences": "{first}; {rest}",
    "enumeration": "{first}, {rest}",
    "jump_measured_well": "godt målt: {what}",
    "jump_counted": "alle punkter i {count} av {pulses} pulser i sikte",
    "jump_counted_controlled": (
        "alle punkter i {count} av {pulses} pulser i sikte, kontrollert av et tredje kamera i {controlled}"
    ),
    "jump_contradicted": (
        "råpunkter som bevegelsen motsier: {count}, mest {point} ved puls {pulse} ({distance} m); bruk de "
        "glattede verdiene der"
    ),
    "jump_enlarged": "standardavvikene i bildene var for små og er økt: {what}",
    "jump_enlarged_points": "punktene {factor} ganger",
    "jump_enlarged_skis": "skiene {factor} ganger",
    "jump_no_takeoff": (
        "satsen ble ikke funnet, så tiden regnes fra den første pulsen: to kameraer må se hoppkanten, og hopperen noen "
        "meter før den"
    ),
    "jump_too_few": "bare {count} av {pulses} pulser viser {what}{where}",
    "jump_all_points": "alle punkter",
    "jump_both_skis": "begge skiene",
    "jump_in_flight": " i svevet",
    "jump_around_edge": " rundt hoppkanten",
    "jump_uncontrolled": (
        "bare i {count} av {pulses} pulser i sikte ser tre kameraer eller flere hvert punkt: ellers "
        "kontrollerer ingenting det som to ser"
    ),
    "jump_coarse": "i {coarse} av {pulses} pulser{where} er et punkt mer usikkert enn {limit} m",
    "jump_gross_errors": "{removed} av {rays} stråler ble tatt ut som grove feil; se protokollen",
    "jump_never_in_sight": "hopperen er aldri i sikte av to kameraer",
    "jump_contradicting": (
        "kamera {camera} har hopperens punkter i bildet {there} ganger, og bare {used} ganger der de andre "
        "kameraene ser dem: sjekk triggeren dets, og om det er flyttet"
    ),
    "jump_left_out": (
        "kamera {camera} er utelatt: det har ingen bilder i dette opptaket, eller er ikke orientert; se protokollen"
    ),
    "jump_no_frame": "kamera {camera} har ikke noe bilde av dette hoppet",
    "jump_untold": (
        "hvilken markør som er hvilken, kan ikke avgjøres, så ingen oppgis: hjelm og hofte ses nesten aldri "
        "sammen, heller ikke alle fire, og ingen binding på skien sin; se på overlegget, og gi markørene mer "
        "kontrast"
    ),
    "jump_untold_point": (
        "{points} oppgis ikke: det som ble målt der, kan være noe annet på hopperen; se på overlegget, og gi "
        "markørene mer kontrast"
    ),
    "jump_untold_points": (
        "{points} oppgis ikke: det som ble målt der, kan være noe annet på hopperen; se på overlegget, og gi "
        "markørene mer kontrast"
    ),
    "jump_never_found": (
        "ingen puls viser {points}: markøren er ikke på, er alltid dekket, eller skiller seg knapt fra det rundt den"
    ),
    "jump_too_short": "færre enn {least} pulser har et punkt i to kameraer: ingenting å glatte",
    "jump_contradictory": "målingene motsier hverandre: sjekk kalibreringen og kameranavnene",
    "why_no_jump_in_part": "{log}: ingen hopper i det, men {part}",
    "why_no_jump": (
        "{log}: ingen hopper i det: ingen puls viser markører som beveger seg slik en hopper gjør; velg et annet "
        "opptak, eller se om innmålingen er i meter med Z opp, og om markørene skiller seg ut"
    ),
    "jump_live": "målt direkte, i {seen} av {pulses} pulser",
    "jump_live_waits": "hva som er godt målt, sier loggen",
    "jump_incomplete": "{missing} av {pulses} pulser kom ikke fram til denne målingen: mål loggen",
    "offset_of_one": (
        "kamera {camera} viser hopperen {ms} ms ({frames} bilder) {which} enn de andre: sjekk triggeren dets"
    ),
    "offset_of_two": (
        "kamera {camera} viser hopperen {ms} ms ({frames} bilder) {which} enn kamera {other}: sjekk triggeren til begge"
    ),
    "offset_later": "senere",
    "offset_earlier": "tidligere",
    "move_turned": "er dreid {turn}",
    "move_turned_parts": "er dreid {size}° ({parts})",
    "move_shifted": "{turned} og flyttet {metres} m",
    "move_part": "{degrees}° {way}",
    "move_calibration": "kamera {camera} {how} siden kalibreringen",
    "move_drift": "kamera {camera} siger: det {how} fra puls {before} til {after}",
    "move_between": "kamera {camera} {how} mellom puls {before} og {after}",
    "way_up": "opp",
    "way_down": "ned",
    "way_left": "til venstre",
    "way_right": "til høyre",
    "way_counter": "mot klokken",
    "way_clockwise": "med klokken",
}
