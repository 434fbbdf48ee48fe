"""Routes of measuring by hand: frames without loss, marks of operators, geometry between images, results."""

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Final, Literal

from anyio.to_thread import run_sync
from fastapi import Depends, Path, Query, Request, Response
from fastapi.responses import FileResponse

from rig.api.digitizing import (
    Action,
    Changed,
    Changes,
    Estimate,
    Geometry,
    HandCurves,
    HandResult,
    Name,
    Opening,
    OperatorName,
    OrientationState,
    PulseView,
    Refined,
    RefineOrder,
    Repeatability,
    SessionView,
    Suggestion,
    TapeOrder,
    Tracking,
    TrackOrder,
)
from webpanel.problems import ProblemError
from webpanel.routes.common import ALONE, CHANGING, NoFields, RecordingId, Responses, refusals, strict_router
from webpanel.routes.dependencies import TheDesks, TheStreams, TheThreads
from webpanel.routes.files import attachment
from webpanel.routes.measuring import FileName

if TYPE_CHECKING:
    from analysis.digitizing.desk import Desk
else:
    Desk = object  # imported when a log is opened; the framework needs a name for it

#: A frame of a closed log never changes.
_KEPT: Final = {"Cache-Control": "private, max-age=31536000, immutable"}
#: So long an answer about changes waits for one, s.
_WAIT_S: Final = 20.0
#: After so long a wait looks whether the service ends, s.
_SLICE_S: Final = 1.0
_PNG: Final[Responses] = {
    200: {
        "description": "The frame, 8 bits of grey.",
        "content": {"image/png": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_FILE: Final[Responses] = {
    200: {
        "description": "The file.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_BYTES: Final = {"schema": {"type": "string", "format": "binary"}}
#: What can be imported, by its media type.
_IMPORTED: Final = {
    "application/json": "measurements.json",
    "text/csv": "marks.csv",
    "application/zip": "dltdv.zip",
}
Exported = Annotated[
    Literal["measurements.json", "network.json", "marks.csv", "dltdv.zip", "argus.zip"],
    Path(description="name of the file"),
]
Operator = Annotated[OperatorName, Path(examples=["Anna"])]
Pulse = Annotated[int, Path(ge=0, le=2**53, description="number of the pulse", examples=[1])]
Coordinate = Annotated[float, Query(ge=-100_000, le=100_000, allow_inf_nan=False, description="px", examples=[320.5])]


def _opened(desks: TheDesks, recording_id: RecordingId) -> Desk:
    return desks.desk(recording_id)


AtDesk = Annotated[Desk, Depends(_opened)]
_LOG: Final = "/recordings/{recording_id}/digitizing"
_SESSION: Final = _LOG + "/sessions/{operator}"
router = strict_router("Measuring by hand")


@router.get(_LOG, responses=refusals(404))
def open_digitizing(desk: AtDesk) -> Opening:
    """What a page needs to begin: cameras, pulses, what became of each frame, what can be measured."""
    return desk.opening()


@router.post(_LOG + "/orientation", status_code=HTTPStatus.ACCEPTED, responses=CHANGING | refusals(404))
def orient_cameras(
    desk: AtDesk,
    operator: Annotated[OperatorName | None, Query(description="by the balls that this operator clicked")] = None,
    _: NoFields = None,
) -> OrientationState:
    """Orient the cameras again, by the balls that the images show by themselves or that an operator clicked."""
    return desk.programs.orient(operator)


@router.get(_LOG + "/frames/{pulse}/{camera}.png", response_class=Response, responses=_PNG | refusals(404))
def get_frame(
    desk: AtDesk,
    pulse: Pulse,
    camera: Annotated[Name, Path(description="name of the camera", examples=["K1"])],
    difference: Annotated[bool, Query(description="its difference from the background")] = False,
) -> Response:
    """A camera's frame without loss."""
    return Response(desk.log.png(pulse, camera, difference=difference), media_type="image/png", headers=_KEPT)


@router.get(_LOG + "/geometry", responses=refusals(404, 409))
def get_geometry(
    desk: AtDesk, operator: OperatorName,
    pulse: Annotated[int, Query(ge=0, le=2**53, description="number of the pulse", examples=[1])],
    camera: Annotated[Name, Query(description="in whose image the place is", examples=["K1"])],
    thing: Annotated[Name, Query(description="what is there", examples=["P1"])],
    x: Coordinate, y: Coordinate,
) -> Geometry:  # fmt: skip
    """What a place in one image means for the others: epipolar curves, the point in space, predicted places."""
    return desk.geometry(operator, pulse, camera, thing, (x, y))


@router.post(_LOG + "/tape", responses=CHANGING | refusals(404))
def measure_length(desk: AtDesk, order: TapeOrder) -> Estimate:
    """The distance between two things, each clicked in two images or more; keeps nothing."""
    return desk.tape(order)


@router.post(_LOG + "/refine", responses=CHANGING | refusals(404))
def refine_place(desk: AtDesk, order: RefineOrder) -> Refined:
    """Find the disc or edge near a click to a part of a pixel, with its sigma; 422 says why there is none."""
    from analysis.digitizing.refining.click import refined  # noqa: PLC0415 - loaded with the first desk

    return refined(desk.log.frame(order.pulse, order.camera), order)


@router.get(_LOG + "/repeatability", responses=refusals(404))
def compare_operators(
    desk: AtDesk,
    operators: Annotated[
        str,
        Query(max_length=400, pattern=r"^[\w .,\-]+$", description="names, with commas between", examples=["Anna,Bo"]),
    ],
) -> Repeatability:
    """How operators agree in what all of them measured: scatter of a click, bias of each, effect on angles."""
    return desk.repeatability(list(dict.fromkeys(name.strip() for name in operators.split(",") if name.strip())))


@router.get(_SESSION, responses=refusals(404))
def get_session(desk: AtDesk, operator: Operator) -> SessionView:
    """How much an operator has measured, and which rays fit worst."""
    return desk.session_view(operator)


@router.get(_SESSION + "/pulses/{pulse}", responses=refusals(404))
def get_pulse_view(desk: AtDesk, operator: Operator, pulse: Pulse) -> PulseView:
    """Everything about one pulse: marks, the automatic measurement, points and skis in space, angles."""
    return desk.view(operator, pulse)


@router.post(_SESSION + "/actions", responses=CHANGING | refusals(404))
def do_action(desk: AtDesk, operator: Operator, action: Action) -> Changed:
    """Set or remove a mark, undo or redo. It is on the disk when this is answered."""
    return desk.act(operator, action)


@router.get(_SESSION + "/next", responses=refusals(404, 409))
def suggest_next(desk: AtDesk, operator: Operator) -> Suggestion | None:
    """Where one more click lowers the sigmas most; null: nowhere, or nothing is known in space yet."""
    return desk.suggestion(operator)


@router.get(_SESSION + "/changes", responses=refusals(404))
async def await_changes(
    streams: TheStreams,
    threads: TheThreads,
    desk: AtDesk,
    operator: Operator,
    since: Annotated[int, Query(ge=0, description="revision that is known")],
) -> Changes:
    """What was changed after a revision, also on another page; waits up to 20 s for a change."""
    left_s = _WAIT_S
    while True:
        found = await run_sync(desk.changes, operator, since, _SLICE_S, limiter=threads.waiting)
        left_s -= _SLICE_S
        if found.revision > since or streams.events.ending or left_s <= 0:
            return found


@router.post(_SESSION + "/track", status_code=HTTPStatus.ACCEPTED, responses=CHANGING | refusals(404))
def track_things(desk: AtDesk, operator: Operator, order: TrackOrder) -> Tracking:
    """Follow things through the images from where they are marked; one undo takes all back."""
    return desk.programs.follow(operator, order)


@router.delete(_SESSION + "/track", responses=CHANGING | refusals(404))
def cancel_tracking(desk: AtDesk, operator: Operator) -> Tracking:
    """Follow no further, and keep nothing of it."""
    return desk.programs.follower.cancel(operator)


@router.get(_SESSION + "/track", responses=refusals(404))
def get_tracking(desk: AtDesk, operator: Operator) -> Tracking:
    """How far the following is, and what it gave."""
    return desk.programs.follower.state(operator)


@router.get(_SESSION + "/export/{name}", response_class=Response, responses=_FILE | refusals(404, 409))
async def export_marks(desk: AtDesk, operator: Operator, name: Exported) -> Response:
    """The marks as a file: measurements, a network of clicked balls, a table, or the folder of DLTdv or Argus."""
    content = await run_sync(_delivered, desk, operator, name)
    headers = {"Content-Disposition": attachment(f"{operator}-{name}")}
    return Response(content, media_type="application/octet-stream", headers=headers)


@router.post(
    _SESSION + "/import",
    responses=CHANGING | refusals(404),
    openapi_extra={"requestBody": {"required": True, "content": dict.fromkeys(_IMPORTED, _BYTES)}},
)
async def import_marks(desk: AtDesk, operator: Operator, request: Request) -> Changed:
    """Take the marks of a file (`measurements.json`, a table, DLTdv's folder as ZIP); one undo takes all back."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    return await run_sync(_taken_in, desk, operator, _IMPORTED.get(kind, ""), await request.body())


@router.get(_SESSION + "/curves", responses=refusals(404))
def get_curves(desk: AtDesk, operator: Operator) -> HandCurves:
    """Curves of all quantities from the newest marks that are computed; asking begins with those that are newer."""
    return desk.programs.curves(operator)


@router.post(_SESSION + "/compute", status_code=HTTPStatus.ACCEPTED, responses=CHANGING | refusals(404))
def compute(desk: AtDesk, operator: Operator, _: NoFields = None) -> HandResult:
    """Compute the jump from what was measured by hand, with the rest of the automatic measurement."""
    return desk.programs.compute(operator)


@router.delete(_SESSION + "/compute", responses=CHANGING | refusals(404))
def cancel_computing(desk: AtDesk, operator: Operator) -> HandResult:
    """Compute no further; an earlier result stays."""
    return desk.programs.computing.cancel(operator)


@router.get(_SESSION + "/result", responses=refusals(404))
def get_result(desk: AtDesk, operator: Operator) -> HandResult:
    """How far the computing is, and what it gave."""
    return desk.programs.computing.result(operator)


@router.get(_SESSION + "/result/files/{name}", response_class=FileResponse, responses=_FILE | refusals(404))
def get_result_file(desk: AtDesk, operator: Operator, name: FileName) -> FileResponse:
    """A file of the result, such as `report.html`."""
    file = desk.programs.computing.file(operator, name)
    if file is None:
        text = f"there is no file {name} of {operator}: compute first"
        raise ProblemError(HTTPStatus.NOT_FOUND, "unknown_file", text)
    shown = file.suffix == ".html"
    offered = {} if shown else {"Content-Disposition": attachment(f"{operator}-{name}")}
    return FileResponse(file, headers=ALONE | offered, media_type="text/html" if shown else "application/octet-stream")


def _delivered(desk: Desk, operator: str, name: str) -> bytes:
    from analysis.digitizing.exchange.delivery import delivered  # noqa: PLC0415 - loaded with the first desk

    return delivered(desk, operator, name)


def _taken_in(desk: Desk, operator: str, name: str, content: bytes) -> Changed:
    from analysis.digitizing.exchange.delivery import taken_in  # noqa: PLC0415 - loaded with the first desk

    return taken_in(desk, operator, name, content)
