"""Routes about all measured jumps of the folder, by athlete."""

from typing import Annotated, Final

from fastapi import Depends, Query, Request, Response
from fastapi.responses import HTMLResponse
from pydantic import TypeAdapter

from rig.api.athletes import Athlete, AthleteJump, JumpQuery
from rig.api.comparison import Comparison, Span
from rig.api.fields import LONGEST_LINE
from rig.api.language import Language
from rig.host.file_names import ID_PATTERN
from webpanel.routes.common import ALONE, Moment, compressed, refusals, strict_router
from webpanel.routes.dependencies import Service

_ATHLETES: Final = TypeAdapter(list[Athlete])
_JUMPS: Final = TypeAdapter(list[AthleteJump])


def _query(
    *,
    athlete: Annotated[
        str, Query(max_length=LONGEST_LINE, description="the whole name; case and spaces do not matter")
    ] = "",
    search: Annotated[str, Query(max_length=LONGEST_LINE, description="words and conditions, as for recordings")] = "",
    since: Annotated[Moment | None, Query(description="taken off at this time or later, with its zone")] = None,
    until: Annotated[Moment | None, Query(description="taken off before this time, with its zone")] = None,
    limit: Annotated[int | None, Query(ge=1, le=100_000, description="at most so many; all if left out")] = None,
) -> JumpQuery:
    return JumpQuery.model_construct(athlete=athlete, search=search, since=since, until=until, limit=limit)


router = strict_router("Athletes")


@router.get("/athletes", response_model=list[Athlete])
def list_athletes(service: Service, request: Request) -> Response:
    """Everybody of whom jumps were measured, by name. Names that differ in case or spaces only are one athlete."""
    return compressed(request, _ATHLETES.dump_json(service.athletes()))


@router.get("/jumps", response_model=list[AthleteJump], responses=refusals(422))
def list_jumps(service: Service, request: Request, query: Annotated[JumpQuery, Depends(_query)]) -> Response:
    """The measured jumps of all recordings that fit everything that is given, newest first; all if nothing is.

    A recording whose athlete is corrected has its jumps under the new name at once. What lies in the trash is left
    out.
    """
    return compressed(request, _JUMPS.dump_json(service.measured_jumps(query)))


@router.get("/jumps/comparison", responses=refusals(409, 422))
def compare_spans(
    service: Service,
    athlete: Annotated[str, Query(min_length=1, max_length=LONGEST_LINE, description="the whole name")],
    first_since: Annotated[Moment, Query(description="beginning of the first span, with its zone")],
    first_until: Annotated[Moment, Query(description="its end")],
    second_since: Annotated[Moment, Query(description="beginning of the second span")],
    second_until: Annotated[Moment, Query(description="its end")],
) -> Comparison:
    """Whether an athlete's jumps of two spans of time differ by more than chance: the second less the first.

    Means are judged by how the jumps scatter within their spans, and the greatest of all differences as the
    greatest of many; two single jumps as `svev compare` does. It takes some seconds, and gives way to a recording.
    """
    first, second = (first_since, first_until), (second_since, second_until)
    return service.compare_spans(athlete, *(Span(since=since, until=until) for since, until in (first, second)))


@router.get("/comparison.html", response_class=HTMLResponse, responses=refusals(404, 409, 422))
def compare_jumps(
    service: Service,
    first: Annotated[str, Query(pattern=f"^{ID_PATTERN}$", description="id of a recording")],
    second: Annotated[str, Query(pattern=f"^{ID_PATTERN}$", description="id of a recording, or the same")],
    first_jump: Annotated[int, Query(ge=1, le=100_000, description="number of its jump")] = 1,
    second_jump: Annotated[int, Query(ge=1, le=100_000, description="number of its jump")] = 1,
    language: Annotated[Language, Query(description="that the page shows first")] = Language.EN,
) -> HTMLResponse:
    """A page that compares two measured jumps, as that of `svev compare`: names, what differs, pictures, curves.

    It needs no other file. It takes some seconds, and gives way to a recording.
    """
    page = service.comparison_page((first, first_jump), (second, second_jump), language.value)
    return HTMLResponse(page, headers=ALONE)
