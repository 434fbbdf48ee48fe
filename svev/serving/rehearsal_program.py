"""The program that rehearses for the service: started by `service.rehearsals`, told and telling by lines of JSON.

The first line of standard input says what to rehearse. Its end, which is also that of the service, ends the rehearsal:
cameras are closed and the log is deleted.
"""

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from recorder.publishing.keys import check_publication
from rig.api.status import RehearsalStage
from rig.errors import SvevError
from rig.host.endings import counted_endings, leave_terminal_to_parent
from rig.phrase import plain
from rig.settings.model import RigSettings
from svev.rehearsal import rehearse


def main() -> None:
    """Rehearse once."""
    leave_terminal_to_parent()
    asked = json.loads(sys.stdin.readline())
    # A rehearsal that is interrupted is not wanted any more.
    with counted_endings((signal.SIGTERM,)) as asks, suppress(KeyboardInterrupt):
        threading.Thread(target=_await_end, daemon=True).start()
        try:
            rig = RigSettings.model_validate(asked["rig"])
            check_publication(rig.network)
            done = rehearse(
                rig, asked["toml"], Path(asked["directory"]), asked["seconds"], lambda _: None, _progress, asks
            )
        except SvevError as error:
            _say({"problem": asdict(error.said)})
        except OSError as error:
            _say({"problem": asdict(plain(f"{error.filename or 'system call'}: {error.strerror}"))})
        else:
            _say({"rehearsed": done.to_json()})


def _await_end() -> None:
    os.read(sys.stdin.fileno(), 1)
    os.kill(os.getpid(), signal.SIGTERM)


@contextmanager
def _progress(_: str, pulses: int | None) -> Iterator[Callable[[int], None]]:
    """Say how far the recording is; behind it, the log is read."""

    def say(done: int) -> None:
        _say({"stage": RehearsalStage.RECORDING, "done": done, "pulses": pulses or 0})

    say(0)
    yield say
    _say({"stage": RehearsalStage.READING, "done": pulses or 0, "pulses": pulses or 0})


def _say(what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
