"""The routes of the rig as a whole: status, arm and disarm, alarms, the rig file, the doctor."""

from http import HTTPStatus
from typing import Annotated

from anyio.to_thread import run_sync
from fastapi import Path

from rig.api.parts import PartsChange, PartsView
from rig.api.rehearsal import RehearsalOrder, Rehearsals
from rig.api.status import ArmOrder, DoctorReport, RigView, Status
from rig.api.trigger import BurstOrder, TriggerChange, TriggerView
from webpanel.routes.common import CHANGING, NoFields, refusals, strict_router
from webpanel.routes.dependencies import Service, TheThreads

AlarmNumber = Annotated[int, Path(ge=1, le=2**31 - 1, description="`number` of the alarm", examples=[1])]

router = strict_router("Rig")


@router.get("/status")
def get_status(service: Service) -> Status:
    """Everything about the running service, at one moment."""
    return service.status()


@router.post("/arm", status_code=HTTPStatus.OK, responses=CHANGING)
def arm(service: Service, order: ArmOrder | None = None) -> Status:
    """Begin to arm: connect the cameras and keep the last seconds from then on. While armed it changes nothing.

    A rehearsal that runs is ended first, without a verdict.

    In a fault because too few cameras answer, `min_cameras` arms without the others, until the rig is disarmed.
    """
    return service.arm(order or ArmOrder())


@router.post("/disarm", status_code=HTTPStatus.OK, responses=CHANGING)
def disarm(service: Service, _: NoFields = None) -> Status:
    """Begin to disconnect the cameras. Not while recording. While idle it changes nothing."""
    return service.disarm()


@router.get("/rig")
def get_rig(service: Service) -> RigView:
    """The rig file in use."""
    return service.rig()


@router.get("/doctor", responses=refusals(503))
async def examine(service: Service, threads: TheThreads) -> DoctorReport:
    """Check everything that a recording depends on, and say what to do; takes some seconds."""
    return await run_sync(service.doctor, limiter=threads.doctor)


@router.get("/trigger")
def get_trigger(service: Service) -> TriggerView:
    """Who makes the pulses, their rate, and what of it can be changed here."""
    return service.trigger()


@router.patch("/trigger", responses=CHANGING)
def change_trigger(service: Service, change: TriggerChange) -> TriggerView:
    """Change the rate of the pulses, where svev makes them. If the rig is armed it is armed anew, at the new rate.

    That takes some seconds, and what was held of the past is gone. Not while a recording runs: 409, as where
    others make the pulses. A rate that source, cameras or this computer's memory do not take is refused (422). The
    logs from then on hold the rig file with the new rate. `save` writes it into the rig file too; else it holds
    until the service ends.

    `running` false stops the pulses while armed, true starts them again, both at once. While they are stopped they
    come on request (`POST /api/trigger/burst`), that they stop is no alarm, and beginning a recording starts them,
    unless its `duration_s` is 0.
    """
    return service.change_trigger(change)


@router.post("/trigger/burst", status_code=HTTPStatus.ACCEPTED, responses=CHANGING)
def burst(service: Service, order: BurstOrder | None = None) -> TriggerView:
    """Have so many pulses made at the rate of the rig, e.g. for pictures of a scene in which nothing moves.

    Only while the rig is armed and its pulses are stopped. The triplets are held in memory as part of the past, for
    `preroll.limit_s` seconds: a recording with `duration_s` 0 keeps them.
    """
    return service.burst(order or BurstOrder())


@router.get("/rehearsal")
def get_rehearsal(service: Service) -> Rehearsals:
    """The rehearsal that runs, and what the last one showed."""
    return service.rehearsals()


@router.post("/rehearsal", status_code=HTTPStatus.ACCEPTED, responses=CHANGING)
def rehearse(service: Service, order: RehearsalOrder | None = None) -> Rehearsals:
    """Begin a rehearsal: record for some seconds with everything that a recording needs, read back, judge, delete.

    Only while the rig is idle: a rehearsal has the cameras for itself, and nothing of it is kept but the verdict.
    If one runs already, this changes nothing. `rehearsal` in the status says how far it is; then ask for
    `GET /rehearsal`. Arming ends it, without a verdict.
    """
    return service.rehearse(order or RehearsalOrder())


@router.delete("/rehearsal", responses=CHANGING)
def end_rehearsal(service: Service) -> Rehearsals:
    """End the rehearsal that runs, without a verdict; answers when the cameras are free."""
    return service.end_rehearsal()


@router.get("/parts")
def get_parts(service: Service) -> PartsView:
    """When a recording goes on in another log, its next part."""
    return service.parts()


@router.patch("/parts", responses=CHANGING)
def change_parts(service: Service, change: PartsChange) -> PartsView:
    """Change when a recording goes on in its next part, from the next recording on: one that runs goes on as it is.

    `save` writes both limits into the rig file too; else they hold until the service ends.
    """
    return service.change_parts(change)


@router.post("/alarms/{number}/acknowledge", responses=CHANGING | refusals(404))
def acknowledge(service: Service, number: AlarmNumber, _: NoFields = None) -> Status:
    """Note that somebody has seen an alarm: it stays, silent on all pages, until it ends or gets worse."""
    return service.acknowledge(number)
