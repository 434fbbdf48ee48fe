"""Roles: what the holder of a token may do, and which role a call needs."""

import re
from collections.abc import Callable
from enum import StrEnum
from typing import Final

from rig.phrase import Phrase, phrase


class Role(StrEnum):
    """What a client may do; each role may do what those before it may."""

    WATCH = "watch"
    OPERATE = "operate"
    ADMINISTER = "administer"

    def may(self, needed: "Role") -> bool:
        """Whether this role may do what needs `needed`."""
        order = list(Role)
        return order.index(self) >= order.index(needed)


READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
#: Calls that change something and are not the operator's: what is deleted and restored, and whatever may come to change
#: the whole rig or the service. Light, regions and pulses are the operator's, also for good: what was set right on the
#: hill must not be lost with the next start.
_ADMINISTERING: Final = (
    re.compile(r"DELETE /api/(recordings|trash)(/[^/]*)?"),
    re.compile(r"POST /api/recordings/[^/]+/restore"),
    re.compile(r"[A-Z]+ /api/(rig|service)(/.*)?"),
)
#: What the link to a recording shows of it; neither the log itself nor what was noted about it, as in `jumper.json`.
_SHOWN_BY_LINK: Final = re.compile(
    r"/api/recordings/([^/]+)(?:/measurement|/measurement/files/(?!jumper\.json)[^/]+|/pulses|/pulses/[^/]+\.jpg|/moment|/thumbnail\.jpg)?"
)
#: What calls did, in words; a call about a recording has its id as the first group.
_ACTS: Final[tuple[tuple[str, Callable[..., Phrase]], ...]] = (
    (r"POST /api/arm", lambda: phrase("act_armed", "armed the rig")),
    (r"POST /api/disarm", lambda: phrase("act_disarmed", "disarmed the rig")),
    (
        r"POST /api/alarms/([^/]+)/acknowledge",
        lambda number: phrase("act_acknowledged", "acknowledged alarm {number}", number=number),
    ),
    (r"POST /api/rehearsal", lambda: phrase("act_rehearsed", "asked for a rehearsal")),
    (r"DELETE /api/rehearsal", lambda: phrase("act_rehearsal_ended", "ended the rehearsal")),
    (r"POST /api/recordings", lambda: phrase("act_started", "started a recording")),
    (r"POST /api/mark", lambda: phrase("act_marked", "marked a jump")),
    (
        r"PATCH /api/cameras/([^/]+)",
        lambda camera: phrase("act_light", "changed exposure, gain or region of {camera}", camera=camera),
    ),
    (r"POST /api/calibration", lambda: phrase("act_calibrating", "began to take pictures of a target")),
    (r"DELETE /api/calibration", lambda: phrase("act_calibrating_ended", "ended the calibration helper")),
    (
        r"DELETE /api/calibration/pictures/last",
        lambda: phrase("act_calibrating_undone", "took back the last picture of a target"),
    ),
    (r"POST /api/calibration/compute", lambda: phrase("act_calibrated", "asked for a calibration to be computed")),
    (
        r"POST /api/calibration/save",
        lambda: phrase("act_calibration_saved", "put the calibration into the rig file"),
    ),
    (r"PATCH /api/trigger", lambda: phrase("act_trigger", "changed the pulses")),
    (r"PATCH /api/parts", lambda: phrase("act_parts", "changed how recordings are split")),
    (r"POST /api/trigger/burst", lambda: phrase("act_burst", "asked for pulses")),
    (r"PUT /api/automatic", lambda: phrase("act_automatic", "changed whether recordings begin by themselves")),
    (
        r"POST /api/recordings/([^/]+)/stop",
        lambda recording: phrase("act_stopped", "stopped recording {recording}", recording=recording),
    ),
    (
        r"PATCH /api/recordings/([^/]+)",
        lambda recording: phrase("act_edited", "edited recording {recording}", recording=recording),
    ),
    (
        r"DELETE /api/recordings/([^/]+)",
        lambda recording: phrase("act_deleted", "deleted recording {recording}", recording=recording),
    ),
    (
        r"POST /api/recordings/([^/]+)/restore",
        lambda recording: phrase("act_restored", "restored recording {recording}", recording=recording),
    ),
    (r"DELETE /api/trash", lambda: phrase("act_emptied", "emptied the trash")),
    (
        r"DELETE /api/trash/([^/]+)",
        lambda recording: phrase("act_removed", "removed recording {recording} for good", recording=recording),
    ),
    (
        r"PUT /api/recordings/([^/]+)/notes/.*",
        lambda recording: phrase("act_noted", "noted something in recording {recording}", recording=recording),
    ),
    (
        r"DELETE /api/recordings/([^/]+)/notes/.*",
        lambda recording: phrase("act_note_removed", "removed a note of recording {recording}", recording=recording),
    ),
    (
        r"POST /api/recordings/([^/]+)/voice-notes",
        lambda recording: phrase("act_spoke", "spoke a note about recording {recording}", recording=recording),
    ),
    (
        r"DELETE /api/recordings/([^/]+)/voice-notes/.*",
        lambda recording: phrase(
            "act_voice_removed", "removed a spoken note of recording {recording}", recording=recording
        ),
    ),
    (
        r"POST /api/recordings/([^/]+)/exports?",
        lambda recording: phrase("act_exported", "asked for an export of recording {recording}", recording=recording),
    ),
    (
        r"POST /api/recordings/([^/]+)/measurement",
        lambda recording: phrase("act_measured", "asked for recording {recording} to be measured", recording=recording),
    ),
    (
        r"DELETE /api/recordings/([^/]+)/measurement",
        lambda recording: phrase("act_not_measured", "gave up measuring recording {recording}", recording=recording),
    ),
    (
        r"POST /api/recordings/([^/]+)/digitizing/(?:orientation|sessions/[^/]+/compute)",
        lambda recording: phrase(
            "act_digitized", "asked for recording {recording}, measured by hand, to be computed", recording=recording
        ),
    ),
    (
        r"DELETE /api/recordings/([^/]+)/digitizing/sessions/[^/]+/compute",
        lambda recording: phrase(
            "act_not_digitized", "gave up computing recording {recording}, measured by hand", recording=recording
        ),
    ),
    (
        r"DELETE /api/recordings/([^/]+)/links/.*",
        lambda recording: phrase(
            "act_link_taken_back", "took back a link to recording {recording}", recording=recording
        ),
    ),
    (r"DELETE /api/exports/[^/]+", lambda: phrase("act_export_ended", "ended or removed an export")),
    (r"[A-Z]+ /api/next-jumper(?:/.*)?", lambda: phrase("act_next_jumper", "edited the next jumper")),
    (r"POST /api/start-list/preview", lambda: phrase("act_list_looked", "looked at a start list before loading it")),
    (r"[A-Z]+ /api/start-list(?:/.*)?", lambda: phrase("act_start_list", "edited the start list")),
)


#: Calls that are not told: each click of who measures by hand is kept with his marks, and would bury the log.
_UNTOLD: Final = re.compile(r"[A-Z]+ /api/recordings/[^/]+/digitizing/(?:tape|refine|sessions/[^/]+/(?!compute).*)")


def needed_role(method: str, path: str) -> Role:
    """The role that a call needs.

    Args:
        method: of the request, upper case.
        path: of the request, or of a route with its parameters in braces.
    """
    if method in READING:
        return Role.WATCH
    call = f"{method} {path}"
    return Role.ADMINISTER if any(pattern.fullmatch(call) for pattern in _ADMINISTERING) else Role.OPERATE


def recording_in(path: str) -> str:
    """Id of the recording that the path of a request is about; empty if it is about none."""
    found = re.fullmatch(r"/api/recordings/([^/]+)(?:/.*)?", path)
    return found[1] if found else ""


def shown_by_link(method: str, path: str, recording: str) -> bool:
    """Whether whoever has the link to a recording, and nothing else, may make a call."""
    found = _SHOWN_BY_LINK.fullmatch(path)
    return method in {"GET", "HEAD"} and found is not None and found[1] == recording


def act(method: str, path: str) -> Phrase | None:
    """What a call that changes something did, in words; e.g. `stopped recording 2026-02-14T10-15-30Z`.

    None: it is not told in the live log.
    """
    call = f"{method} {path}"
    if _UNTOLD.fullmatch(call):
        return None
    for pattern, words in _ACTS:
        if found := re.fullmatch(pattern, call):
            return words(*found.groups())
    return phrase("act_called", "called {call}", call=call)
