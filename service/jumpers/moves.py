"""From one start list to the next: order of jumpers, fields taken over. Pure functions of immutable lists."""

from collections.abc import Iterable

from rig.api.recordings import NextJumper, SessionFields
from rig.api.start_list import NewLine, StartLine, StartList, TurnMark
from rig.errors import UnknownLineError
from rig.phrase import phrase


def line_of(start_list: StartList, line: int) -> StartLine:
    """The line of this id.

    Raises:
        UnknownLineError: there is none.
    """
    for each in start_list.lines:
        if each.id == line:
            return each
    raise UnknownLineError(
        phrase(
            "list_no_line", "the start list has no line {line}: see the list, somebody may have removed it", line=line
        )
    )


def with_line(start_list: StartList, changed: StartLine) -> StartList:
    """The list with another content of one line."""
    lines = tuple(changed if each.id == changed.id else each for each in start_list.lines)
    return start_list.model_copy(update={"lines": lines})


def with_next(start_list: StartList, line: int | None) -> StartList:
    """The list with the jumper of a line next; None: somebody who stands in no line, with the fields carried over."""
    before = start_list.next
    session: dict[str, str] = {name: getattr(before.session, name) for name in start_list.carry}
    more: dict[str, str] = {}
    if line is not None:
        found = line_of(start_list, line)
        session |= {name: text for name, text in _session_of(found) if text or name in {"bib", "athlete"}}
        more = _more_of(found)
    following = NextJumper(
        number=before.number + 1, version=before.version, line=line, session=SessionFields(**session), more=more
    )
    return start_list.model_copy(update={"next": following})


def advanced(start_list: StartList) -> StartList:
    """The list with the following jumper next: the first who waits after the present one, else from the top.

    After somebody who stands in no line comes the jumper before whom he was put. When nobody waits any more, the next
    round begins.
    """
    present = start_list.next
    waiting = _waiting_after(start_list, present.line)
    if present.line is None and any(each.id == present.following for each in start_list.lines):
        waiting = present.following
    if waiting is None and start_list.lines:
        start_list = new_round(start_list)
        waiting = start_list.lines[0].id
    return with_next(start_list, waiting)


def new_round(start_list: StartList) -> StartList:
    """The list with everybody waiting again, one round later."""
    lines = tuple(each.model_copy(update={"mark": TurnMark.WAITING}) for each in start_list.lines)
    return start_list.model_copy(update={"lines": lines, "round": start_list.round + 1})


def taken(start_list: StartList, recording: str) -> StartList:
    """The list after the next jumper's recording has begun."""
    line = start_list.next.line
    if line is not None:
        found = line_of(start_list, line)
        update = {"mark": TurnMark.JUMPED, "jumps": (*found.jumps, recording)}
        start_list = with_line(start_list, found.model_copy(update=update))
    return advanced(start_list) if start_list.auto_advance else start_list


def not_taken(start_list: StartList, recording: str) -> StartList:
    """The list without a recording that was none: its jumper waits again."""
    for each in start_list.lines:
        if recording in each.jumps:
            jumps = tuple(jump for jump in each.jumps if jump != recording)
            return with_line(start_list, each.model_copy(update={"mark": TurnMark.WAITING, "jumps": jumps}))
    return start_list


def renamed(start_list: StartList, recording: str, name: str) -> StartList:
    """The list with another id of a recording."""
    for each in start_list.lines:
        if recording in each.jumps:
            jumps = tuple(name if jump == recording else jump for jump in each.jumps)
            return with_line(start_list, each.model_copy(update={"jumps": jumps}))
    return start_list


def skipped(start_list: StartList) -> StartList:
    """The list after the next jumper was passed over; one who has jumped in this round has jumped."""
    line = start_list.next.line
    if line is not None and (found := line_of(start_list, line)).mark is TurnMark.WAITING:
        start_list = with_line(start_list, found.model_copy(update={"mark": TurnMark.SKIPPED}))
    return advanced(start_list)


def edited(start_list: StartList, changes: dict[str, str]) -> StartList:
    """The list with other session fields of the next jumper.

    A bib of the list makes the jumper of that line the next one. Any other bib makes it somebody outside the list,
    whose name is not the line's; the line keeps waiting. Other fields are corrections for this jump.
    """
    bib, present = changes.get("bib"), start_list.next
    if bib is not None and bib != present.session.bib:
        line = next((each.id for each in start_list.lines if bib and each.bib == bib), None)
        if line is not None or present.line is not None:
            start_list = with_next(start_list, line)
            pushed = present.line if present.following is None else present.following
            update = {"following": pushed}  # also while a bib of the list is only the beginning of what is being typed
            start_list = start_list.model_copy(update={"next": start_list.next.model_copy(update=update)})
    session = start_list.next.session.model_copy(update=changes)
    return start_list.model_copy(update={"next": start_list.next.model_copy(update={"session": session})})


def with_lines(start_list: StartList, new: Iterable[NewLine]) -> StartList:
    """The list with these jumpers at its end; the first of them is next if nobody is named by now."""
    first = max((each.id for each in start_list.lines), default=0) + 1
    added = [StartLine(id=first + index, **each.model_dump()) for index, each in enumerate(new)]
    changed = start_list.model_copy(update={"lines": (*start_list.lines, *added)})
    changed = _with_columns(changed)
    nobody = start_list.next.line is None and not (start_list.next.session.bib or start_list.next.session.athlete)
    return with_next(changed, added[0].id) if nobody and added else changed


def moved(start_list: StartList, line: int, place: int) -> StartList:
    """The list with a line at another place, counted from 1."""
    found = line_of(start_list, line)
    lines = [each for each in start_list.lines if each.id != line]
    lines.insert(place - 1, found)
    return start_list.model_copy(update={"lines": tuple(lines)})


def changed_line(start_list: StartList, changed: StartLine) -> StartList:
    """The list with another content of a line, which the next jumper takes over if it is his."""
    start_list = _with_columns(with_line(start_list, changed))
    following = start_list.next
    if following.line == changed.id:
        session = following.session.model_copy(update=dict(_session_of(changed)))
        following = following.model_copy(update={"session": session, "more": _more_of(changed)})
    return start_list.model_copy(update={"next": following})


def without_line(start_list: StartList, line: int) -> StartList:
    """The list without a line; if it was the next jumper's, the following one is next."""
    line_of(start_list, line)
    if start_list.next.line == line:
        waiting = _waiting_after(start_list, line)
        start_list = with_next(start_list, waiting if waiting != line else None)
    lines = tuple(each for each in start_list.lines if each.id != line)
    return _with_columns(start_list.model_copy(update={"lines": lines}))


def _waiting_after(start_list: StartList, line: int | None) -> int | None:
    """The first line after this one that waits, else the first from the top; this one itself comes last."""
    lines = list(start_list.lines)
    place = next((index for index, each in enumerate(lines) if each.id == line), -1)
    ordered = lines[place + 1 :] + lines[: place + 1]
    return next((each.id for each in ordered if each.mark is TurnMark.WAITING), None)


def _session_of(line: StartLine) -> tuple[tuple[str, str], ...]:
    return (("bib", line.bib), ("athlete", line.athlete), ("gate", line.gate), ("notes", line.notes))


def _more_of(line: StartLine) -> dict[str, str]:
    return ({"club": line.club} if line.club else {}) | {name: text for name, text in line.more.items() if text}


def _with_columns(start_list: StartList) -> StartList:
    """The list with the names of all own columns, in the order in which they first appear."""
    names = {name: None for each in start_list.lines for name in each.more}
    return start_list.model_copy(update={"columns": tuple(names)})
