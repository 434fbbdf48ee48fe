"""The route by which somebody says that he has seen an alarm."""

from typing import Annotated

from fastapi import APIRouter, Path

from rig.api.status import Status
from service.seam.rig import RigService
from webpanel.routes.common import CHANGING, NoFields, refusals, strict_router

AlarmNumber = Annotated[int, Path(ge=1, le=2**31 - 1, description="`number` of the alarm", examples=[1])]


def alarms_router(service: RigService) -> APIRouter:
    """The routes about alarms."""
    router = strict_router("Rig")

    @router.post("/alarms/{number}/acknowledge", responses=CHANGING | refusals(404))
    def acknowledge(number: AlarmNumber, _: NoFields = None) -> Status:
        """Note that somebody has seen an alarm: it stays, silent on all pages, until it ends or gets worse."""
        return service.acknowledge(number)

    return router
