"""The start list and the commands that change it or the next jumper, in the form of the REST API."""

from enum import StrEnum
from typing import Annotated, Final, Literal

from pydantic import Field, StrictBool

from rig.api.fields import WHOLE, Line, Model, Text, WholeNumber
from rig.api.recordings import NextJumper, SessionChange, SessionFields
from rig.api.statement import Statement

#: As many lines and own columns as a start list may have, and the length of a column's name.
LINES_MAX: Final = 2000
COLUMNS_MAX: Final = 12
COLUMN_NAME_MAX: Final = 40
#: The largest file that a start list is loaded from.
TABLE_BYTES_MAX: Final = 2_000_000

LineId = Annotated[int, Field(ge=1)]
ColumnName = Annotated[str, Field(pattern=rf"^[^\x00-\x1f\x7f]{{1,{COLUMN_NAME_MAX}}}$")]
#: What a line has in own columns.
More = Annotated[
    dict[ColumnName, Line],
    Field(max_length=COLUMNS_MAX, description="own columns", json_schema_extra={"additionalProperties": False}),
]
#: Fields of one jumper; the other session fields may be carried over to the next one.
FieldName = Literal["athlete", "bib", "gate", "wind", "notes", "operator"]


class TurnMark(StrEnum):
    """What became of a line of the start list in the present round."""

    WAITING = "waiting"
    JUMPED = "jumped"
    SKIPPED = "skipped"


class NewLine(Model):
    """A jumper for the start list."""

    bib: Line = Field("", examples=["17"])
    athlete: Line = Field("", examples=["Ola Nordmann"])
    gate: Line = Field("", examples=["12"])
    club: Line = Field("", examples=["Lyn"])
    notes: Text = Field("", examples=["new boots"])
    more: More = Field({}, examples=[{"class": "J18"}])


class StartLine(NewLine):
    """A line of the start list."""

    id: LineId
    mark: TurnMark = Field(TurnMark.WAITING, description="in the present round")
    jumps: tuple[str, ...] = Field((), description="ids of his recordings, all rounds, oldest first")


class LineChange(Model):
    """What is to be changed of a line; what is left out stays as it is."""

    bib: Line | None = Field(None, examples=["18"])
    athlete: Line | None = Field(None, examples=["Ola Nordmann"])
    gate: Line | None = Field(None, examples=["11"])
    club: Line | None = Field(None, examples=["Lyn"])
    notes: Text | None = Field(None, examples=["new boots"])
    more: More | None = Field(None, examples=[{"class": "J20"}])
    place: Annotated[int, Field(ge=1, le=LINES_MAX), WHOLE] | None = Field(
        None, description="moves the line there, counted from 1", examples=[3]
    )


class Rules(Model):
    """What happens from one jumper to the next; what is left out stays as it is."""

    auto_advance: StrictBool | None = Field(
        None, description="somebody else is next as soon as a recording has begun", examples=[True]
    )
    carry: tuple[FieldName, ...] | None = Field(
        None, description="fields that the next jumper takes over from the one before", examples=[["gate", "wind"]]
    )


class JumperChange(SessionChange):
    """Session fields of the next jumper to change; a field that is left out stays as it is."""

    number: WholeNumber | None = Field(
        None,
        description="`number` of the jumper whom the change is about: refused if another one is next by now",
        examples=[None],
    )


class Turn(Model):
    """Which next jumper a command is about."""

    number: WholeNumber | None = Field(
        None,
        description="`number` of the jumper whom the operator saw: if another one is next by now, nothing changes",
        examples=[None],
    )


class UndoOrder(Model):
    """Which change is to be undone."""

    version: WholeNumber | None = Field(
        None,
        description="`version` that the operator saw: refused if something has changed since",
        examples=[None],
    )


class StartList(Model):
    """The order of the jumpers, the next one, and what happens from one jumper to the next."""

    version: int = Field(0, description="counts up with every change")
    round: int = Field(1, description="counts up when everybody has jumped or was skipped")
    auto_advance: bool = Field(True, description="somebody else is next as soon as a recording has begun")
    carry: tuple[FieldName, ...] = Field(
        ("gate", "wind", "operator"), description="fields that the next jumper takes over from the one before"
    )
    columns: tuple[str, ...] = Field((), description="own columns of the list")
    lines: tuple[StartLine, ...] = ()
    next: NextJumper = NextJumper()
    undo: Statement | None = Field(None, description="the last change, which can be undone; null: there is none")


class ReadingChoice(Model):
    """One way to read a file whose letters can be read in several."""

    encoding: str = Field(examples=["mac-roman"])
    words: tuple[str, ...] = Field(description="texts of the list that differ, as this way has them")


class Preview(Model):
    """What a file would make of the start list, before it does."""

    jumpers: int = Field(description="how many it has; 0: a heading alone, which would empty the list")
    lines: tuple[NewLine, ...] = Field(description="the first of them")
    columns: tuple[str, ...] = Field(description="that its heading names, known ones by our names for them")
    added: tuple[str, ...] = Field(description="columns that the present list has not")
    removed: tuple[str, ...] = Field(description="columns that the present list has and this one has not")
    heading: int = Field(description="number of the line of the heading; lines above it are skipped")
    encoding: str | None = Field(description="of its letters; null: a workbook, or one has to be chosen")
    sheet: str | None = Field(description="of a workbook; null: the file is none, or one has to be chosen")
    readings: tuple[ReadingChoice, ...] = Field(description="choose one as `encoding`; empty: its letters are certain")
    sheets: tuple[str, ...] = Field(description="choose one as `sheet`; empty: one alone holds a list")


def who(fields: SessionFields | NewLine) -> str:
    """Bib and name, or what there is of them."""
    return " ".join(text for text in (fields.bib, fields.athlete) if text) or "nobody in particular"
