"""Routes of the calibration helper: pictures of a target, the calibration that comes of them, and its use."""

from http import HTTPStatus

from fastapi.responses import FileResponse

from rig.api.calibrating import Calibrating, CalibratingOrder
from webpanel.routes.common import ALONE, CHANGING, NoFields, refusals, strict_router
from webpanel.routes.dependencies import Service

router = strict_router("Calibration")


@router.get("/calibration")
def get_calibration(service: Service) -> Calibrating:
    """What the helper sees, the pictures that are missing, the kept ones, and their result.

    Whoever asks keeps it going: after a minute in which nobody does, it looks at pictures no more.
    """
    return service.calibrating.view()


@router.post("/calibration", responses=CHANGING)
def begin_calibration(service: Service, order: CalibratingOrder | None = None) -> Calibrating:
    """Look for targets of `svev target` in live pictures, and keep a picture whenever one is still in a new pose.

    All cameras that show it at that pulse count. The pictures are kept without loss in `folder`, beside the
    recordings. Pictures that are there already go on, unless `anew` is true, their calibration is in the rig file,
    or regions of cameras or the target are others. The rig must be armed; while a recording runs the helper waits.
    """
    return service.calibrating.begin(order or CalibratingOrder())


@router.delete("/calibration", responses=CHANGING)
def end_calibration(service: Service) -> Calibrating:
    """Look at pictures no more, or give up computing. The pictures stay."""
    return service.calibrating.end()


@router.delete("/calibration/pictures/last", responses=CHANGING)
def undo_picture(service: Service) -> Calibrating:
    """Remove the pictures of the pulse that was kept last. Until the target was moved there is no other one."""
    return service.calibrating.undo()


@router.post("/calibration/compute", status_code=HTTPStatus.ACCEPTED, responses=CHANGING)
def compute_calibration(service: Service, _: NoFields = None) -> Calibrating:
    """Compute a calibration from the kept pictures, as `svev calibrate --pictures` does; ask until it is `done`."""
    return service.calibrating.compute()


@router.post("/calibration/save", responses=CHANGING)
def save_calibration(service: Service, _: NoFields = None) -> Calibrating:
    """Put the calibration into the rig file. The logs have it from then on.

    Cameras that it lacks keep the calibration that they had; without one this is refused (422).
    """
    return service.calibrating.save()


@router.get("/calibration/protocol.html", response_class=FileResponse, responses=refusals(409))
def get_calibration_protocol(service: Service) -> FileResponse:
    """The protocol of the calibration: verdict, coverage, grid, residuals, all figures."""
    return FileResponse(service.calibrating.protocol(), headers=ALONE, media_type="text/html; charset=utf-8")
