"""The part of the seam that is about the start list and the next jumper."""

from typing import Protocol

from rig.api.start_list import JumperChange, LineChange, NewLine, Preview, Rules, StartList, Turn, UndoOrder


class Jumpers(Protocol):
    """The start list and the next jumper, one for all. Any thread may call any method; each gives the list then.

    Raises (each where it applies):
        UnknownLineError: the start list has no such line.
        ChangedMeanwhileError: the call is about another state of the list than the present one.
        StateForbidsError: the list as it is forbids the call.
        BadInputError: a table cannot be read; the message names line and column.
    """

    def view(self) -> StartList:
        """The list as it is now."""
        ...

    def change_next(self, change: JumperChange) -> StartList:
        """Change session fields of the next jumper."""
        ...

    def skip(self, turn: Turn) -> StartList:
        """Pass over the next jumper; if another one is next by now, nothing changes."""
        ...

    def choose(self, line: int) -> StartList:
        """Make the jumper of a line the next one."""
        ...

    def add(self, new: NewLine) -> StartList:
        """Add a line at the end."""
        ...

    def change_line(self, line: int, change: LineChange) -> StartList:
        """Change a line, or move it."""
        ...

    def remove(self, line: int) -> StartList:
        """Remove a line."""
        ...

    def preview(self, content: bytes, encoding: str | None = None, sheet: str | None = None) -> Preview:
        """What a table would make of the list; letters and sheet as a person has said, None: nobody has."""
        ...

    def import_table(self, content: bytes, encoding: str | None = None, sheet: str | None = None) -> StartList:
        """Replace the list by a table; empty content clears it."""
        ...

    def change_rules(self, rules: Rules) -> StartList:
        """Change what happens from one jumper to the next."""
        ...

    def begin_round(self) -> StartList:
        """Have everybody wait again, from the top of the list."""
        ...

    def undo(self, order: UndoOrder) -> StartList:
        """Take the last change back."""
        ...
