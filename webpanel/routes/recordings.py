"""The routes of recordings and of the trash: start and stop, list, change, delete and restore, remove for good."""

from http import HTTPStatus
from typing import Annotated, Final

from fastapi import Body, Depends, Query, Request, Response
from pydantic import TypeAdapter

from rig.api.automatic import AutomaticChange, JumpMark, Marked
from rig.api.fields import LONGEST_LINE, LONGEST_TAG
from rig.api.recordings import (
    Recording,
    RecordingOrder,
    RecordingQuery,
    SessionChange,
    Sorting,
    StopOrder,
    Trash,
)
from rig.api.statement import Level
from rig.api.status import Status
from webpanel.routes.common import (
    CHANGING,
    Moment,
    NoFields,
    RecordingId,
    Responses,
    compressed,
    refusals,
    strict_router,
)
from webpanel.routes.dependencies import Service, TheChanges

_ALL_HELD: Final = RecordingOrder()
_ORDER: Final = Body(
    openapi_examples={
        "a jump": {"value": {"athlete": "Ola Nordmann", "bib": "17", "gate": "12", "duration_s": 10}},
        "what has just happened": {"value": {"bib": "17", "preroll_s": 5, "duration_s": 0}},
    }
)
_RECORDINGS: Final = TypeAdapter(list[Recording])
_LISTED: Final[Responses] = {
    200: {
        "headers": {
            "X-Total-Count": {"description": "how many fit, on all pages", "schema": {"type": "integer"}},
            "Link": {"description": 'the next page, `rel="next"`, if there is one', "schema": {"type": "string"}},
        }
    }
}
_LOCATED: Final = {"headers": {"Location": {"description": "address of the recording", "schema": {"type": "string"}}}}


def _query(
    *,
    deleted: Annotated[bool, Query(description="those in the trash instead")] = False,
    search: Annotated[
        str,
        Query(
            max_length=LONGEST_LINE,
            description="words in the id or any text of the session, and conditions such as `alpha > 48`; all of them",
            examples=["berg date:2026-11-21 alpha > 48"],
        ),
    ] = "",
    athlete: Annotated[str, Query(max_length=LONGEST_LINE, description="part of the athlete's name")] = "",
    bib: Annotated[str, Query(max_length=LONGEST_LINE, description="the bib, exactly")] = "",
    since: Annotated[Moment | None, Query(description="begun at this time or later, with its zone")] = None,
    until: Annotated[Moment | None, Query(description="begun before this time, with its zone")] = None,
    verdict: Annotated[Level | None, Query(description="how grave the verdict is")] = None,
    tag: Annotated[str, Query(max_length=LONGEST_TAG, description="a tag of the recording")] = "",
    favourite: Annotated[bool | None, Query(description="true: favourites only; false: all others")] = None,
    sort: Annotated[Sorting, Query(description="order of the list")] = Sorting.NEWEST,
    offset: Annotated[int, Query(ge=0, le=2**31, description="leave out so many at the front")] = 0,
    limit: Annotated[int | None, Query(ge=1, le=1000, description="at most so many; all if left out")] = None,
) -> RecordingQuery:
    return RecordingQuery(
        deleted=deleted, search=search, athlete=athlete, bib=bib, since=since, until=until, verdict=verdict, tag=tag,
        favourite=favourite, sort=sort, offset=offset, limit=limit,
    )  # fmt: skip


router = strict_router("Recordings")


@router.post("/recordings", status_code=HTTPStatus.CREATED, responses=CHANGING | {201: _LOCATED})
def start_recording(
    service: Service, response: Response, order: Annotated[RecordingOrder, _ORDER] = _ALL_HELD
) -> Recording:
    """Start a recording. The rig must be armed and not be recording already.

    It is of the next jumper, unless `bib` or `athlete` says of whom: then nothing else is filled in, and the next
    jumper stays the next one.

    If `preroll_s` is left out, the recording begins with all seconds that are held in memory; if `duration_s` is
    left out, it lasts until it is stopped. `{"duration_s": 0}` saves what has just happened, and ends by itself.
    """
    recording = service.start_recording(order)
    response.headers["Location"] = f"/api/recordings/{recording.id}"
    return recording


@router.post("/mark", responses=CHANGING | refusals(422))
def mark(service: Service, mark: JumpMark | None = None) -> Marked:
    """A jump begins, says a light barrier or a timing system: record it, with the seconds before.

    How many seconds before and after is said by `[automatic]` in the rig file. While a recording runs, the mark is
    written into its log, and nothing else happens: a barrier that a ski breaks twice begins one recording.
    """
    return service.mark(mark or JumpMark())


@router.put("/automatic", responses=CHANGING)
def change_automatic(service: Service, change: AutomaticChange) -> Status:
    """Let recordings begin by themselves when something moves (`[automatic.motion]` in the rig file), or not."""
    return service.change_automatic(change)


@router.post("/recordings/{recording_id}/stop", responses=CHANGING | refusals(404))
def stop_recording(service: Service, recording_id: RecordingId, order: StopOrder | None = None) -> Recording:
    """Stop a recording; answers when its file is closed. A recording that has ended is not changed.

    A page sends `seen`, so that a second tap on its button does not end a recording that has only just begun.
    """
    return service.stop_recording(recording_id, order or StopOrder())


@router.get("/recordings", response_model=list[Recording], responses=_LISTED)
def list_recordings(service: Service, request: Request, query: Annotated[RecordingQuery, Depends(_query)]) -> Response:
    """The recordings that fit everything that is given: all of them, newest first, if nothing is.

    With `limit` the list comes page by page: `X-Total-Count` says how many fit altogether, and `Link` where the
    next page is.
    """
    found = service.recordings(query)
    headers = {"X-Total-Count": str(found.total)}
    if query.limit is not None and query.offset + query.limit < found.total:
        onward = request.url.include_query_params(offset=query.offset + query.limit)
        headers["Link"] = f'<{onward.path}?{onward.query}>; rel="next"'
    return compressed(request, _RECORDINGS.dump_json(found.recordings), headers)


@router.get("/recordings/{recording_id}", responses=refusals(404))
def get_recording(service: Service, recording_id: RecordingId, request: Request) -> Recording:
    """One recording, in the trash or not. A link to it shows who jumped, and nothing that was noted about him."""
    recording, caller = service.recording(recording_id), request.state.caller
    return _without_notes(recording) if caller.recording else recording


@router.patch("/recordings/{recording_id}", responses=CHANGING | refusals(404))
def change_recording(
    service: Service, changes: TheChanges, recording_id: RecordingId, change: SessionChange
) -> Recording:
    """Change session fields; those that are left out stay as they are. The log itself is not changed."""
    recording = service.change_session(recording_id, change)
    changes.recordings_changed()
    return recording


@router.delete("/recordings/{recording_id}", responses=CHANGING | refusals(404))
def delete_recording(service: Service, changes: TheChanges, recording_id: RecordingId) -> Recording:
    """Put a recording into the trash. If the trash holds this id already, the answer gives the new id."""
    recording = service.delete_recording(recording_id)
    changes.recordings_changed()
    return recording


@router.post("/recordings/{recording_id}/restore", responses=CHANGING | refusals(404))
def restore_recording(
    service: Service, changes: TheChanges, recording_id: RecordingId, _: NoFields = None
) -> Recording:
    """Take a recording out of the trash. If another recording has its id by now, the answer gives the new id."""
    recording = service.restore_recording(recording_id)
    changes.recordings_changed()
    return recording


@router.get("/trash")
def get_trash(service: Service) -> Trash:
    """How much lies in the trash. What lies there: `GET /recordings?deleted=true`."""
    return service.trash()


@router.delete("/trash", responses=CHANGING)
def empty_trash(service: Service, changes: TheChanges) -> Trash:
    """Empty the trash: what was deleted is removed for good, which frees its room. Answers what was removed."""
    gone = service.empty_trash()
    changes.recordings_changed()
    return gone


@router.delete("/trash/{recording_id}", responses=CHANGING | refusals(404))
def remove_recording(service: Service, changes: TheChanges, recording_id: RecordingId) -> Trash:
    """Remove one recording for good; it must lie in the trash."""
    gone = service.remove_recording(recording_id)
    changes.recordings_changed()
    return gone


def _without_notes(recording: Recording) -> Recording:
    session = recording.session.model_copy(update={"notes": "", "operator": ""})
    return recording.model_copy(update={"session": session, "tags": (), "more": {}, "favourite": False})
