"""Routes about what was measured in a recording: its figures, its files, and the order to measure it (again)."""

from http import HTTPStatus
from typing import Annotated, Final

from fastapi import Path, Query, Request
from fastapi.responses import FileResponse

from rig.api.measuring import Measurement
from webpanel.door.roles import shown_by_link
from webpanel.routes.common import ALONE, CHANGING, NoFields, RecordingId, Responses, refusals, strict_router
from webpanel.routes.dependencies import A_DOWNLOAD, Service
from webpanel.routes.files import attachment

FileName = Annotated[
    str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]{0,99}$", description="name of a file", examples=["report.html"])
]
WithJumps = Annotated[
    bool, Query(description="with `jumps` in full, some 400 kB each; false: `null` stands in their place")
]
_FILE: Final[Responses] = {
    200: {
        "description": "The file.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
#: What a browser shows itself.
_SHOWN: Final = {
    ".html": "text/html; charset=utf-8",
    ".jpg": "image/jpeg",
    ".txt": "text/plain; charset=utf-8",
    ".mp4": "video/mp4",
}

router = strict_router("Measurements")


@router.get("/recordings/{recording_id}/measurement", responses=refusals(404, 409))
def get_measurement(
    service: Service, recording_id: RecordingId, request: Request, jumps: WithJumps = True
) -> Measurement:
    """What is known of the jumps of a recording, and how far its measuring is.

    The log of every recording is measured by itself after its end, if the rig file has `[analysis]`; until then the
    figures are those that were measured live (`live`), and `jumps` is empty. Progress is in `measuring` of
    `GET /status` and its events.
    """
    found, caller = service.measurement(recording_id, jumps=jumps), request.state.caller
    own = f"/api/recordings/{recording_id}/measurement/files"
    files = [
        name for name in found.files if not caller.recording or shown_by_link("GET", f"{own}/{name}", recording_id)
    ]
    return found.model_copy(update={"files": tuple(files)})


@router.post(
    "/recordings/{recording_id}/measurement", status_code=HTTPStatus.ACCEPTED, responses=CHANGING | refusals(404)
)
def measure(service: Service, recording_id: RecordingId, _: NoFields = None) -> Measurement:
    """Have a recording measured, or measured again. It waits for those before it, and while a recording runs."""
    return service.measure(recording_id)


@router.delete("/recordings/{recording_id}/measurement", responses=CHANGING | refusals(404))
def give_up_measuring(service: Service, recording_id: RecordingId) -> Measurement:
    """Do not measure a recording that waits for it, or is being measured; an earlier result stays."""
    return service.give_up_measuring(recording_id)


@router.get(
    "/recordings/{recording_id}/measurement/files/{name}",
    response_class=FileResponse,
    dependencies=[A_DOWNLOAD],
    responses=_FILE | refusals(404, 409, 503),
)
def get_measured_file(service: Service, recording_id: RecordingId, name: FileName) -> FileResponse:
    """A file of the result: the coach's page `report.html`, tables, C3D, TRC, the protocol, the network.

    Refused (409) for a moment after the session was corrected, where the file says whose jump it is.
    """
    file = service.measured_file(recording_id, name)
    shown = _SHOWN.get(file.suffix)
    offered = {} if shown else {"Content-Disposition": attachment(f"{recording_id}-{name}")}
    return FileResponse(file, headers=ALONE | offered, media_type=shown or "application/octet-stream")
