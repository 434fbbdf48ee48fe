"""Seen x report: what the reports of the recorder say of the processes of a rig; nothing runs."""

from dataclasses import replace
from typing import Any

import msgspec
import pytest

from rig.phrase import plain
from rig.transport.recorder_reports import CameraChanged, CameraNews, RecorderHealth, RecorderReady, RecorderWarm
from service.processes.seen import CameraPresence, Processes, Seen
from tests.service.computer.test_overload import _health
from triggering.timeline.steady_rate import SteadyRate

CONNECTED, SILENT, GONE = CameraNews.CONNECTED, CameraNews.SILENT, CameraNews.GONE


def _changed(news: CameraNews, camera: int = 0) -> CameraChanged:
    return CameraChanged(camera=camera, news=news, said=plain("a camera"))


def _record(frames_per_s: float) -> RecorderHealth:
    """A health record in which the first camera delivers so many frames, and the others 30."""
    health = _health((0, 0, 0))
    first = msgspec.structs.replace(health.cameras[0], frames_per_s=frames_per_s)
    return RecorderHealth(health=msgspec.structs.replace(health, cameras=(first, *health.cameras[1:])))


@pytest.mark.parametrize(
    ("reports", "news"),
    [
        ((), None),
        ((_changed(CONNECTED),), CONNECTED),
        ((_changed(CONNECTED), _changed(CameraNews.NOTICE)), CONNECTED),
        ((_changed(CONNECTED), _changed(GONE)), GONE),
        ((_changed(SILENT), _record(30.0)), SILENT),  # one record may be of before
        ((_changed(SILENT), _record(30.0), _record(30.0)), CONNECTED),
        ((_changed(SILENT), _record(30.0), _record(0.0), _record(30.0)), SILENT),
        ((_changed(GONE), _record(30.0), _record(30.0)), GONE),
    ],
)
def test_a_camera_is_what_was_said_of_it_last_and_a_silent_one_that_delivers_twice_is_there(
    reports: tuple[Any, ...], news: CameraNews | None
) -> None:
    seen = Seen.begun(3)
    for report in reports:
        seen = seen.heard(report)
    assert seen.cameras is not None
    assert seen.cameras[0].news is news
    assert seen.cameras[1:] == (CameraPresence(),) * 2


def test_a_recorder_that_dies_leaves_nothing_known_but_that_pulses_stand_still() -> None:
    seen = replace(Seen.begun(3), still=True).heard(RecorderReady()).heard(_changed(CONNECTED)).heard(_record(30.0))
    seen = seen.heard(RecorderWarm(rate_hz=30.0, rate_error=0.01)).heard(RecorderWarm())
    assert (seen.ready, seen.warm, seen.rate) == (True, True, SteadyRate(30.0, 0.01))
    dead = seen.without_recorder()
    assert dead == replace(Seen.begun(3), processes=Processes.NO_RECORDER, still=True)
