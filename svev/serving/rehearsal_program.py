"""The program that rehearses for the service, started by `service.rehearsals`.

When the service tells it to end, or has ended, the rehearsal ends: cameras are closed and the log is deleted.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

from recorder.publishing.keys import check_publication
from rig.api.status import RehearsalProgress, RehearsalStage
from rig.errors import SvevError
from rig.phrase import plain
from rig.transport.child import ChildContext, begin
from rig.transport.message import Quit
from service.rehearsals import NoVerdict, RehearsalGoes, Rehearse, Rehearsed
from svev.rehearsal import rehearse
from svev.serving.panel_doctor import shown

#: To close the cameras and delete the log.
_GRACE_S: Final = 5.0


def main() -> None:
    """Rehearse once."""
    child = begin(Rehearse, Quit, _GRACE_S)
    with suppress(KeyboardInterrupt):  # a rehearsal that is interrupted is not wanted any more
        try:
            child.control.send(_rehearsed(child))
        except SvevError as error:
            child.control.send(NoVerdict(said=error.said))
        except OSError as error:
            child.control.send(NoVerdict(said=plain(f"{error.filename or 'system call'}: {error.strerror}")))


def _rehearsed(child: ChildContext[Rehearse]) -> Rehearsed:
    @contextmanager
    def progress(_: str, pulses: int | None) -> Iterator[Callable[[int], None]]:
        """Say how far the recording is; behind it, the log is read."""

        def say(done: int, stage: RehearsalStage = RehearsalStage.RECORDING) -> None:
            child.control.send(RehearsalGoes(progress=RehearsalProgress(stage=stage, done=done, pulses=pulses or 0)))

        say(0)
        yield say
        say(pulses or 0, RehearsalStage.READING)

    asked = child.config
    check_publication(asked.rig.network)
    done = rehearse(
        asked.rig, asked.toml, asked.directory, asked.seconds, lambda _: None, progress, lambda: int(child.stopping())
    )
    return Rehearsed(
        verdict=done.verdict,
        pulses=done.pulses,
        complete=done.complete,
        headroom=done.headroom,
        jumps=done.jumps,
        spread_us=None if done.spread_us is None else done.spread_us["median"],
        findings=tuple(map(shown, done.findings)),
    )


if __name__ == "__main__":
    main()
