"""The routes of the next jumper and the start list: one for all devices, and for every recording."""

from http import HTTPStatus
from typing import Annotated, Final, Literal

from fastapi import Path, Query, Request
from starlette.concurrency import run_in_threadpool

from rig.api.recordings import NextJumper
from rig.api.start_list import JumperChange, LineChange, NewLine, Preview, Rules, StartList, Turn, UndoOrder
from webpanel.door.guard import ANY_BYTES
from webpanel.problems import ProblemError
from webpanel.routes.common import CHANGING, NoFields, refusals, strict_router
from webpanel.routes.dependencies import Service

LineNumber = Annotated[int, Path(ge=1, le=10**9, description="id of a line of the start list", examples=[3])]
_CSV: Final = "text/csv"
_XLSX: Final = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"
Encoding = Annotated[
    Literal["utf-8", "utf-16-le", "utf-16-be", "windows-1252", "mac-roman", "cp850"] | None,
    Query(description="of its letters, where they can be read in several ways", examples=[None]),
]
SheetName = Annotated[
    str | None, Query(max_length=100, description="of a workbook with several lists", examples=[None])
]
_TABLE: Final = {
    "requestBody": {
        "required": False,
        "content": {
            _CSV: {
                "schema": {"type": "string"},
                "example": "bib;athlete;gate;club\n17;Ola Nordmann;12;Lyn\n18;Kari Hansen;12;Koll\n",
            },
            _XLSX: {"schema": {"type": "string", "format": "binary"}},
            ANY_BYTES: {"schema": {"type": "string", "format": "binary"}},
        },
    }
}

router = strict_router("Jumpers")


@router.get("/next-jumper")
def get_next_jumper(service: Service) -> NextJumper:
    """Whom the next recording is of."""
    return service.jumpers.view().next


@router.patch("/next-jumper", responses=CHANGING)
def change_next_jumper(service: Service, change: JumperChange) -> NextJumper:
    """Change session fields of the next jumper; a recording in progress is not changed.

    A bib of the start list makes the jumper of that line the next one. Another bib makes it somebody who stands in
    no line: name and notes are cleared, and the line waits.
    """
    return service.jumpers.change_next(change).next


@router.post("/next-jumper/skip", responses=CHANGING)
def skip_next_jumper(service: Service, turn: Turn | None = None) -> StartList:
    """Pass over the next jumper: the following one of the start list is next, or nobody in particular."""
    return service.jumpers.skip(turn or Turn())


@router.get("/start-list")
def get_start_list(service: Service) -> StartList:
    """The start list, with who is next and what the last change was."""
    return service.jumpers.view()


@router.put("/start-list", responses=CHANGING, openapi_extra=_TABLE)
async def import_start_list(
    service: Service, request: Request, encoding: Encoding = None, sheet: SheetName = None
) -> StartList:
    """Replace the start list by a table, a line of which names the columns; the first jumper is next.

    Columns are `bib`, `athlete` (or first and last name), `gate`, `club`, `notes` in any order, and own ones, which
    are written into the logs too; lines above them are skipped. CSV with semicolons, commas or tabs in UTF-8,
    UTF-16, Windows-1252 or Mac Roman, or an Excel workbook; the content tells which. What is wrong is refused with
    the line and the column, and so are letters that can be read in several ways. `undo` brings the old list back.
    A heading alone is refused; empty content clears the list.
    """
    return await run_in_threadpool(service.jumpers.import_table, await _table_in(request), encoding, sheet)


@router.post("/start-list/preview", responses=CHANGING, openapi_extra=_TABLE)
async def preview_start_list(
    service: Service, request: Request, encoding: Encoding = None, sheet: SheetName = None
) -> Preview:
    """What a table would make of the start list, before `PUT` replaces it; nothing is changed.

    Where letters can be read in several ways, or several sheets hold a list, it says which there are to choose.
    """
    return await run_in_threadpool(service.jumpers.preview, await _table_in(request), encoding, sheet)


@router.patch("/start-list", responses=CHANGING)
def change_rules(service: Service, rules: Rules) -> StartList:
    """Change what happens from one jumper to the next: whether the list goes on by itself, what is carried over."""
    return service.jumpers.change_rules(rules)


@router.post("/start-list/undo", responses=CHANGING)
def undo_change(service: Service, order: UndoOrder | None = None) -> StartList:
    """Take the last change of the start list back, step by step; recordings stay as they are."""
    return service.jumpers.undo(order or UndoOrder())


@router.post("/start-list/round", responses=CHANGING)
def begin_round(service: Service, _: NoFields = None) -> StartList:
    """Begin the next round: everybody waits, and the first of the list is next."""
    return service.jumpers.begin_round()


async def _table_in(request: Request) -> bytes:
    content = await request.body()
    if content and not request.headers.get("content-type", "").startswith((_CSV, _XLSX, ANY_BYTES)):
        text = f"the body must be a table: send Content-Type: {_CSV}, or that of an Excel workbook, {_XLSX}"
        raise ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", text)
    return content


@router.post("/start-list/lines", status_code=HTTPStatus.CREATED, responses=CHANGING)
def add_line(service: Service, line: NewLine) -> StartList:
    """Add a jumper at the end of the start list."""
    return service.jumpers.add(line)


@router.patch("/start-list/lines/{line}", responses=CHANGING | refusals(404))
def change_line(service: Service, line: LineNumber, change: LineChange) -> StartList:
    """Change a line, or move it to another `place`."""
    return service.jumpers.change_line(line, change)


@router.delete("/start-list/lines/{line}", responses=CHANGING | refusals(404))
def remove_line(service: Service, line: LineNumber) -> StartList:
    """Remove a line; the jumper's recordings stay."""
    return service.jumpers.remove(line)


@router.post("/start-list/lines/{line}/choose", responses=CHANGING | refusals(404))
def choose_line(service: Service, line: LineNumber, _: NoFields = None) -> StartList:
    """Make the jumper of this line the next one; after him the list goes on with those who follow him."""
    return service.jumpers.choose(line)
