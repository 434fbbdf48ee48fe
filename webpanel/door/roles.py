"""Roles: what the holder of a token may do, and which role a call needs."""

import re
from enum import StrEnum
from typing import Final


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
#: Calls that change something and are not the operator's: what is deleted and restored, and the rig itself.
_ADMINISTERING: Final = (
    re.compile(r"DELETE /api/(recordings|trash)(/[^/]*)?"),
    re.compile(r"POST /api/recordings/[^/]+/restore"),
    re.compile(r"[A-Z]+ /api/(rig|service)(/.*)?"),
)
_ACTS: Final = (
    (r"POST /api/arm", "armed the rig"),
    (r"POST /api/disarm", "disarmed the rig"),
    (r"POST /api/recordings", "started a recording"),
    (r"POST /api/recordings/([^/]+)/stop", "stopped recording {}"),
    (r"PATCH /api/recordings/([^/]+)", "edited recording {}"),
    (r"DELETE /api/recordings/([^/]+)", "deleted recording {}"),
    (r"POST /api/recordings/([^/]+)/restore", "restored recording {}"),
    (r"DELETE /api/trash", "emptied the trash"),
    (r"DELETE /api/trash/([^/]+)", "removed recording {} for good"),
    (r"PUT /api/recordings/([^/]+)/notes/.*", "noted something in recording {}"),
    (r"DELETE /api/recordings/([^/]+)/notes/.*", "removed a note of recording {}"),
    (r"POST /api/recordings/([^/]+)/exports?", "asked for an export of recording {}"),
    (r"DELETE /api/exports/[^/]+", "ended or removed an export"),
    (r"[A-Z]+ /api/next-jumper(?:/.*)?", "edited the next jumper"),
    (r"[A-Z]+ /api/start-list(?:/.*)?", "edited the start list"),
)


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


def act(method: str, path: str) -> str:
    """What a call that changes something did, in words; e.g. `stopped recording 2026-02-14T10-15-30Z`."""
    call = f"{method} {path}"
    for pattern, words in _ACTS:
        if found := re.fullmatch(pattern, call):
            return words.format(*found.groups())
    return f"called {call}"
