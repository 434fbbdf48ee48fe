"""The rig as a whole: status, arm and disarm, the rig file, the doctor."""

from http import HTTPStatus

import anyio
import anyio.to_thread
from fastapi import APIRouter

from webpanel.api_errors import CHANGING, refusals
from webpanel.models import DoctorReport, RigView, Status
from webpanel.rig_service import RigService
from webpanel.routes_recordings import NoFields
from webpanel.strict_route import strict_router


def rig_router(service: RigService) -> APIRouter:
    """The routes of the rig."""
    router = strict_router("Rig")
    # Whoever waits for the doctor must not keep the threads from those who want to stop a recording.
    one_at_a_time = anyio.CapacityLimiter(1)

    @router.get("/status")
    def get_status() -> Status:
        """Everything about the running service, one moment's picture."""
        return service.status()

    @router.post("/arm", status_code=HTTPStatus.OK, responses=CHANGING)
    def arm(_: NoFields = None) -> Status:
        """Begin to arm: cameras are set up, and the last seconds are kept from then on. Twice is as good as once."""
        return service.arm()

    @router.post("/disarm", status_code=HTTPStatus.OK, responses=CHANGING)
    def disarm(_: NoFields = None) -> Status:
        """Begin to let the cameras go. Not while recording. Twice is as good as once."""
        return service.disarm()

    @router.get("/rig")
    def get_rig() -> RigView:
        """The rig file in use."""
        return service.rig()

    @router.get("/doctor", responses=refusals(503))
    async def examine() -> DoctorReport:
        """Look at everything that a recording stands on, and say what to do; takes some seconds."""
        return await anyio.to_thread.run_sync(service.doctor, limiter=one_at_a_time)

    return router
