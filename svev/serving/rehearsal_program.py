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
from types import FrameType
from typing import Any, Final

from recorder.publishing.keys import check_publication
from rig.api.status import RehearsalStage
from rig.errors import SvevError
from rig.phrase import plain
from rig.settings.model import RigSettings
from svev.rehearsal import rehearse

#: What a terminal sends to all programs of its window; the service says what they mean.
_OF_THE_TERMINAL: Final = (signal.SIGINT, signal.SIGHUP, signal.SIGTSTP)


def main() -> None:
    """Rehearse once."""
    for number in _OF_THE_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _interrupt)
    asked = json.loads(sys.stdin.readline())
    threading.Thread(target=_await_end, daemon=True).start()
    with suppress(KeyboardInterrupt):  # it is not wanted any more
        try:
            rig = RigSettings.model_validate(asked["rig"])
            check_publication(rig.network)
            done = rehearse(rig, asked["toml"], Path(asked["directory"]), asked["seconds"], lambda _: None, _progress)
        except SvevError as error:
            _say({"problem": asdict(error.said)})
        except OSError as error:
            _say({"problem": asdict(plain(f"{error.filename or 'system call'}: {error.strerror}"))})
        else:
            _say({"rehearsed": done.to_json()})


def _interrupt(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # once: what it has to tidy up is not to be interrupted
    raise KeyboardInterrupt


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
