"""What `svev setup` says, in English and Norwegian."""

from typing import Final

#: Both texts under a key that says what it is about; values stand in braces.
_WORDS: Final[dict[str, tuple[str, str]]] = {
    "begin": (
        (
            "Svev asks what it needs to know of this hill. Enter takes the answer in [brackets]; Ctrl-C ends, and then "
            "nothing has been changed."
        ),
        (
            "Svev spør om det som trengs for denne bakken. Enter tar svaret i [klammer]; Ctrl-C avslutter, og da er "
            "ingenting endret."
        ),
    ),
    "files_in": ("Its files are in {folder}.", "Filene ligger i {folder}."),
    "none": ("none", "ingen"),
    "yes": ("yes", "ja"),
    "no": ("no", "nei"),
    "yes_or_no": ("  yes or no, please", "  ja eller nei, takk"),
    "ended": ("ended; nothing has been changed", "avsluttet; ingenting er endret"),
    "language": ("English or Norwegian (en or nb)?", "Engelsk eller norsk (en eller nb)?"),
    "name": ("What is the hill called?", "Hva heter bakken?"),
    "searching": ("Looking for cameras ...", "Leter etter kameraer ..."),
    "found": ("{number}  {what}", "{number}  {what}"),
    "no_picture": ("     no picture: {why}", "     ikke noe bilde: {why}"),
    "search_failed": ("The search for cameras failed: {why}", "Letingen etter kameraer mislyktes: {why}"),
    "pictures": (
        "A picture of each camera, with its number, is on this page: {page}",
        "Et bilde fra hvert kamera, med nummeret, står på denne siden: {page}",
    ),
    "cameras": (
        "Which cameras, from left to right, as they look at the hill? Numbers, e.g. 2 1 3:",
        "Hvilke kameraer, fra venstre mot høyre, slik de ser bakken? Numre, f.eks. 2 1 3:",
    ),
    "none_found": (
        (
            "No camera answers. Check power and cables, that the network port has an address in the camera's subnet "
            "(svev cameras list), and that no firewall blocks UDP port 3956."
        ),
        (
            "Ingen kameraer svarer. Sjekk strøm og kabler, at nettverksporten har en adresse i kameraets subnett "
            "(svev cameras list), og at ingen brannmur sperrer UDP-port 3956."
        ),
    ),
    "firewire": ("FireWire: {why}", "FireWire: {why}"),
    "addresses": (
        "Enter looks again{today}; or type the cameras' addresses from left to right:",
        "Enter leter igjen{today}; eller skriv adressene til kameraene fra venstre mot høyre:",
    ),
    "or_keep": (', "keep" leaves them as they are', ", «keep» lar dem være som de er"),
    "silent": (
        "  {camera} does not answer now; it is written down all the same",
        "  {camera} svarer ikke nå; det blir skrevet opp likevel",
    ),
    "of_today_silent": (
        '{camera} of the rig file does not answer; "keep" leaves the cameras as they are',
        "{camera} i riggfilen svarer ikke; «keep» lar kameraene være som de er",
    ),
    "trigger_list": (
        (
            "The pulses that expose all cameras at once come from\n"
            "  external        a pulse generator of its own, by cable\n"
            "  triggerbox      a trigger box on a serial line\n"
            "  gpio            a line of this computer\n"
            "  action          this computer, over the network (GigE Vision cameras)\n"
            "  iidc-broadcast  this computer, over the bus (FireWire cameras)\n"
            "  software        this computer, each camera by itself: to try things, not to measure"
        ),
        (
            "Pulsene som eksponerer alle kameraene samtidig, kommer fra\n"
            "  external        en egen pulsgenerator, med kabel\n"
            "  triggerbox      en triggerboks på en seriell linje\n"
            "  gpio            en linje på denne datamaskinen\n"
            "  action          denne datamaskinen, over nettverket (GigE Vision-kameraer)\n"
            "  iidc-broadcast  denne datamaskinen, over bussen (FireWire-kameraer)\n"
            "  software        denne datamaskinen, hvert kamera for seg: for å prøve, ikke for å måle"
        ),
    ),
    "trigger": ("Which of them?", "Hvilken av dem?"),
    "rate": ("How many pulses a second?", "Hvor mange pulser i sekundet?"),
    "input": (
        "Into which input of the cameras does the trigger cable go{inputs}?",
        "Hvilken inngang på kameraene går triggerkabelen til{inputs}?",
    ),
    "inputs": (" (they have {list})", " (de har {list})"),
    "port": ("Which device file is the trigger box?", "Hvilken enhetsfil er triggerboksen?"),
    "line": (
        "Which line makes the pulses (number or name, gpioinfo lists them)?",
        "Hvilken linje lager pulsene (nummer eller navn, gpioinfo viser dem)?",
    ),
    "survey": (
        'File of the surveyed balls; "none" if there is none yet:',
        "Fil med de innmålte ballene; «ingen» hvis den ikke finnes ennå:",
    ),
    "surveyed": ("  {points} surveyed balls, cameras {cameras}", "  {points} innmålte kuler, kameraer {cameras}"),
    "recordings": ("Folder for the recordings:", "Mappe for opptakene:"),
    "free": ("  {free:.1f} GB free there", "  {free:.1f} GB ledig der"),
    "phones": (
        "Shall phones and other computers reach the page?",
        "Skal telefoner og andre datamaskiner nå siden?",
    ),
    "call": (
        "By which names and addresses do they call this computer?",
        "Med hvilke navn og adresser kaller de på denne datamaskinen?",
    ),
    "https": (
        "Protect the page by a certificate (HTTPS; phones are told once to trust it)?",
        "Beskytte siden med et sertifikat (HTTPS; telefonene må stole på det én gang)?",
    ),
    "wrote": ("wrote {path}", "skrev {path}"),
    "kept": ("{path} is as it was", "{path} er som før"),
    "backup": ("the former one is {path}", "den forrige er {path}"),
    "address": ("the page: {url}", "siden: {url}"),
    "token": (
        "its token, asked for once by each phone: {token}",
        "nøkkelen, som hver telefon spør om én gang: {token}",
    ),
    "authority": (
        "phones trust it when {path} is installed on them: docs/how-to/hill-pc.md says how",
        "telefonene stoler på den når {path} er installert på dem: docs/how-to/hill-pc.md sier hvordan",
    ),
    "start_by_hand": ("start it: {command}", "start den: {command}"),
    "needs_root": (
        "As a service it starts with the computer. That writes to {folder} and needs root; type:",
        "Som tjeneste starter den med datamaskinen. Det skriver i {folder} og krever root; skriv:",
    ),
    "start_service": ("Start the service; type:", "Start tjenesten; skriv:"),
    "rehearsing": (
        "Rehearsing: some seconds are recorded, read back and deleted ...",
        "Generalprøve: noen sekunder tas opp, leses tilbake og slettes ...",
    ),
    "not_rehearsed": ("the rehearsal failed: {why}", "generalprøven mislyktes: {why}"),
    "broken_off": ("it was ended before its time", "den ble avbrutt"),
    "again": (
        "Correct that, then: svev rehearse --rig {rig}",
        "Rett det, og så: svev rehearse --rig {rig}",
    ),
    "ready": ("ready: {verdict}", "klar: {verdict}"),
}


def said(language: str, word: str, **values: object) -> str:
    """A text in a language, "en" or "nb"."""
    return _WORDS[word][language == "nb"].format(**values)
