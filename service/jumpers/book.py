"""The one start list of the service with the one next jumper, which all devices and every recording share."""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from rig.api.recordings import NextJumper, RecordingOrder, SessionFields
from rig.api.start_list import (
    LINES_MAX,
    JumperChange,
    LineChange,
    NewLine,
    Preview,
    Rules,
    StartLine,
    StartList,
    Turn,
    UndoOrder,
    who,
)
from rig.api.statement import Statement
from rig.errors import BadInputError, ChangedMeanwhileError, StateForbidsError
from rig.phrase import phrase
from service.jumpers import moves
from service.jumpers.keeper import Change, Keeper
from service.jumpers.preview import previewed
from service.jumpers.table import Table, read_table, readings_of

_UNDO_MAX: Final = 30
#: How long a call waits until its change is on the disk; then it goes on, and an event says that it is not.
_ON_DISK_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class _Taken:
    """What a recording took: the next jumper then, and the one who was next after it had begun."""

    recording: str
    jumper: NextJumper
    after: NextJumper


class JumperBook:
    """Any thread may call any method; changes come one after the other, and each is kept over a restart.

    Args:
        keeper: keeps the list; None: it is forgotten with the service.
        changed: called after every change, in the thread that made it.

    Attributes:
        shown: the next jumper as the status shows him: the following one only when the recording of the one before is
            shown too, so that nobody sees a new name beside an old state.
    """

    def __init__(self, keeper: Keeper | None = None, changed: Callable[[], None] = lambda: None) -> None:
        self._keeper, self._changed = keeper, changed
        self._lock = threading.Lock()
        self._list, changes = keeper.load() if keeper is not None else (StartList(), ())
        self.shown = self._list.next
        self._changes = deque(changes, maxlen=_UNDO_MAX)
        self._taken: _Taken | None = None

    def view(self) -> StartList:
        """The list as it is now."""
        return self._list

    def announce(self) -> None:
        """Show the next jumper: the status says by now whose recording has begun."""
        with self._lock:
            self.shown = self._list.next

    def take(self, recording: str, order: RecordingOrder) -> tuple[SessionFields, dict[str, str]]:
        """Say whom a recording is of, and go on to the following jumper.

        An order that names a jumper is about him alone: nothing is filled in, and the next jumper stays the next one.

        Args:
            recording: id of the recording.
            order: its fields are taken rather than those of the next jumper.

        Returns:
            The session fields, and what else the start list has of the jumper.
        """
        given = order.model_dump(include=set(SessionFields.model_fields))
        if order.bib or order.athlete:
            return SessionFields(**given), {}
        with self._lock:
            jumper, number = self._list.next, self._list.round
            said = _statement("undo_taken", f"{who(jumper.session)} was recorded", jumper.session)
            before = self.shown
            self._put(moves.taken(self._list, recording), said)
            self.shown = before
            self._taken = _Taken(recording, jumper, self._list.next)
        session = jumper.session.model_copy(update={name: text for name, text in given.items() if text})
        return session, jumper.more | ({} if jumper.line is None else {"round": str(number)})

    def give_back(self, recording: str) -> None:
        """Note that a recording was none: its jumper waits again, and is next unless somebody has changed that."""
        with self._lock:
            taken, self._taken = self._taken, None
            if taken is None or taken.recording != recording:
                return
            changed, now = moves.not_taken(self._list, recording), self._list.next
            if (now.number, now.session) == (taken.after.number, taken.after.session):
                back = taken.jumper.model_copy(update={"number": now.number + 1})
                changed = changed.model_copy(update={"next": back})
            said = _statement("undo_back", f"{who(taken.jumper.session)} is to jump again", taken.jumper.session)
            self._put(changed, said)
        self._tell()

    def rename(self, recording: str, name: str) -> None:
        """Note that a recording that has just been taken has another id."""
        with self._lock:
            if self._taken is not None and self._taken.recording == recording:
                self._taken, before = replace(self._taken, recording=name), self.shown
                self._put(moves.renamed(self._list, recording, name))
                self.shown = before

    def change_next(self, change: JumperChange) -> StartList:
        """Change session fields of the next jumper.

        Raises:
            ChangedMeanwhileError: another jumper is next by now.
        """
        with self._lock:
            self._same(change.number)
            fields = change.model_dump(exclude_none=True, exclude={"number"})
            self._put(moves.edited(self._list, fields))
        return self._done()

    def skip(self, turn: Turn) -> StartList:
        """Pass over the next jumper; if another one is next by now than the caller saw, nothing changes."""
        with self._lock:
            if turn.number not in {None, self._list.next.number}:
                return self._list
            session = self._list.next.session
            self._put(moves.skipped(self._list), _statement("undo_skip", f"{who(session)} was skipped", session))
        return self._done()

    def choose(self, line: int) -> StartList:
        """Make the jumper of a line the next one.

        Raises:
            UnknownLineError: there is no such line.
        """
        with self._lock:
            found = moves.line_of(self._list, line)
            said = _statement("undo_choose", f"{who(found)} was made the next jumper", found)
            self._put(moves.with_next(self._list, line), said)
        return self._done()

    def add(self, new: NewLine) -> StartList:
        """Add a line at the end.

        Raises:
            StateForbidsError: the list is full, or somebody else has this bib.
        """
        with self._lock:
            if len(self._list.lines) >= LINES_MAX:
                text = "the start list has {most} lines, which is the most: remove some"
                raise StateForbidsError(phrase("list_full", text, most=LINES_MAX))
            self._free_bib(new.bib)
            said = _statement("undo_add", f"{who(new)} was added", new)
            self._put(moves.with_lines(self._list, (new,)), said)
        return self._done()

    def change_line(self, line: int, change: LineChange) -> StartList:
        """Change a line, or move it.

        Raises:
            UnknownLineError: there is no such line.
            StateForbidsError: somebody else has this bib.
        """
        with self._lock:
            before = moves.line_of(self._list, line)
            fields = change.model_dump(exclude_none=True, exclude={"place"})
            if "bib" in fields:
                self._free_bib(fields["bib"], line)
            changed = self._list
            if fields:
                changed = moves.changed_line(changed, before.model_copy(update=fields))
            if change.place is not None:
                changed = moves.moved(changed, line, change.place)
            self._put(changed, _statement("undo_change", f"the line of {who(before)} was changed", before))
        return self._done()

    def remove(self, line: int) -> StartList:
        """Remove a line; his recordings stay.

        Raises:
            UnknownLineError: there is no such line.
        """
        with self._lock:
            found = moves.line_of(self._list, line)
            said = _statement("undo_remove", f"{who(found)} was removed", found)
            self._put(moves.without_line(self._list, line), said)
        return self._done()

    def preview(self, content: bytes, encoding: str | None = None, sheet: str | None = None) -> Preview:
        """What a table would make of the list.

        Raises:
            BadInputError: the table cannot be read; the message names line and column.
        """
        return previewed(readings_of(content, encoding, sheet), self._list)

    def import_table(self, content: bytes, encoding: str | None = None, sheet: str | None = None) -> StartList:
        """Replace the list by a table, or clear it by empty content.

        Raises:
            BadInputError: the table cannot be read, or not in one way only; or it is a heading alone. The message names
                line and column.
        """
        table = Table((), ())
        if content.strip():
            table = read_table(content, encoding, sheet)
            if not table.lines:
                text = "the table is a heading alone, without a jumper: to empty the start list send empty content"
                raise BadInputError(phrase("list_heading_alone", text))
        with self._lock:
            said = Statement(
                code="undo_import",
                text=f"a list of {len(table.lines)} jumpers was loaded",
                values={"jumpers": len(table.lines)},
            )
            empty = self._list.model_copy(update={"lines": (), "columns": (), "round": 1})
            changed = moves.with_lines(moves.with_next(empty, None), table.lines)
            self._put(changed.model_copy(update={"columns": table.columns}), said)
        return self._done()

    def change_rules(self, rules: Rules) -> StartList:
        """Change what happens from one jumper to the next."""
        with self._lock:
            self._put(self._list.model_copy(update=rules.model_dump(exclude_none=True)))
        return self._done()

    def begin_round(self) -> StartList:
        """Have everybody wait again, from the top of the list."""
        with self._lock:
            said = Statement(code="undo_round", text="a new round was begun")
            changed = moves.new_round(self._list)
            self._put(moves.with_next(changed, changed.lines[0].id if changed.lines else None), said)
        return self._done()

    def undo(self, order: UndoOrder) -> StartList:
        """Take the last change back. Recordings stay as they are.

        Raises:
            StateForbidsError: there is nothing to undo.
            ChangedMeanwhileError: something has changed since the caller looked.
        """
        with self._lock:
            if order.version not in {None, self._list.version}:
                raise ChangedMeanwhileError(
                    phrase(
                        "list_changed", "the start list has changed since: look at it, then undo what is to be undone"
                    )
                )
            if not self._changes:
                text = "there is nothing to undo: no earlier start list is kept"
                raise StateForbidsError(phrase("list_nothing_to_undo", text))
            before = self._changes.pop().before
            number = self._list.next.number + 1
            back = before.model_copy(update={"next": before.next.model_copy(update={"number": number})})
            self._taken = None
            self._put(back)
        return self._done()

    def _put(self, changed: StartList, said: Statement | None = None) -> None:
        """Make a list the present one, and give it to the keeper; `said`: it can be undone."""
        if said is not None:
            self._changes.append(Change(said=said, before=self._list))
        version = self._list.version + 1
        undo = self._changes[-1].said if self._changes else None
        update = {"version": version, "undo": undo, "next": changed.next.model_copy(update={"version": version})}
        self._list = changed.model_copy(update=update)
        self.shown = self._list.next
        if self._keeper is not None:
            self._keeper.keep(self._list, tuple(self._changes))

    def _done(self) -> StartList:
        """Tell of a change that a caller has made, and wait a little until it is kept."""
        found = self._list
        self._tell()
        if self._keeper is not None:
            self._keeper.wait(_ON_DISK_S)
        return found

    def _tell(self) -> None:
        self._changed()

    def _same(self, number: int | None) -> None:
        if number not in {None, self._list.next.number}:
            name = who(self._list.next.session)
            raise ChangedMeanwhileError(
                phrase(
                    "list_other_next",
                    "the next jumper is {name} by now: look at the name, and correct the jump before in "
                    "the list of jumps",
                    name=name,
                )
            )

    def _free_bib(self, bib: str, line: int | None = None) -> None:
        holder = next((each for each in self._list.lines if bib and each.bib == bib and each.id != line), None)
        if holder is not None:
            text = "bib {bib} is that of {who} in the start list: choose another, or remove it"
            raise StateForbidsError(phrase("list_bib_taken", text, bib=bib, who=who(holder)))


def _statement(code: str, text: str, fields: SessionFields | StartLine | NewLine) -> Statement:
    return Statement(code=code, text=text, values={"who": who(fields)})
