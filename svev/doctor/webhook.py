"""Examines the webhook: can it be reached, and does it take a notification?"""

import socket
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime
from typing import Final
from urllib.parse import urlsplit

from rig.api.statement import Level
from rig.api.status import State
from rig.errors import BadInputError
from rig.settings.model import RigSettings
from service.alarms.delivery import Target, deliver, read_target
from service.alarms.occasions import Notification
from svev.doctor.finding import Finding, Topic, failure, passed, warning

#: A receiver that has not accepted a connection after this time is called away, s.
LOOK_S: Final = 3.0
_PORTS: Final = {"http": 80, "https": 443}


def look_at_webhook(rig: RigSettings) -> Iterator[Finding]:
    """Can the receiver of notifications be reached? Nothing is sent to it."""
    if rig.service.webhook is None:
        return
    try:
        target = read_target(rig.service.webhook)
    except BadInputError as error:
        remedy = "correct the file; notifications are not sent until then"
        yield warning(Topic.NETWORK, "check_webhook_file", "webhook: {why}", remedy, why=error.said)
        return
    place, host = urlsplit(target.url), target.host
    try:
        with closing(socket.create_connection((host, place.port or _PORTS[place.scheme]), LOOK_S)):
            what = "the webhook at {host} can be reached; svev doctor --send-test sends it a notification"
            yield passed(Topic.NETWORK, "check_webhook", what, host=host)
    except OSError as error:
        what = "the webhook at {host} cannot be reached ({why})"
        remedy = "see whether this computer has a way there; notifications wait until it can be reached"
        why = error.strerror or "no answer"
        yield warning(Topic.NETWORK, "check_webhook_away", what, remedy, host=host, why=why)


def target_of(rig: RigSettings) -> Target:
    """Where a test goes.

    Raises:
        BadInputError: the rig file names no webhook, or its files cannot be read.
    """
    if rig.service.webhook is None:
        raise BadInputError("the rig file names no webhook: add the table [service.webhook] with url to it")
    return read_target(rig.service.webhook)


def send_test(rig: RigSettings, target: Target) -> Iterator[Finding]:
    """Send a notification that says it is a test."""
    test = Notification(
        event="test", time=datetime.now(UTC), rig=rig.name, state=State.IDLE, level=Level.INFO,
        text=f"a test of the notifications of {rig.name}",
    )  # fmt: skip
    refused = deliver(target, test.model_dump_json().encode())
    if refused is None:
        what = "the webhook at {host} took the test: see whether it shows it"
        yield passed(Topic.NETWORK, "check_webhook_test", what, host=target.host)
    else:
        what, remedy = "the webhook does not take the test: {why}", "correct it, then send the test again"
        yield failure(Topic.NETWORK, "check_webhook_no_test", what, remedy, why=refused.said)
