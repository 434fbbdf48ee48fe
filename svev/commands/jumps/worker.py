"""`svev worker`: measures the jumper from published triplets, live or replayed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import typer
import zmq

from analysis.cameras.oriented_scene import OrientedScene
from analysis.result import file as result_file
from analysis.worker.findings import MeasuredJump
from analysis.worker.live import LiveAnalysis
from analysis.worker.stream import Source, connected, public_key
from recorder.publishing.publisher import bind, live_topic
from rig.clocks import UtcNs
from rig.errors import StorageError
from rig.events import Level
from rig.host.endings import counted_endings
from rig.jumper import JumperState
from rig.phrase import Phrase
from rig.pulse import PulseNumber
from rig.topics import DEFAULT_PUBLISH, JUMPER
from svev import console
from svev.commands.logs.contents import AlsoJson
from svev.commands.networks.delivery import PosesOption, SurveyOption

_TOPIC: Final = live_topic(JUMPER)
#: Topic of whole jumps; who subscribes to `jumper` gets them too.
_JUMP_TOPIC: Final = _TOPIC + b"/jump"
_POLL_S: Final = 0.2
_LINGER_MS: Final = 2000
_MARKS: Final = {Level.ERROR: "error: ", Level.WARNING: "warning: "}


def worker_command(
    connect: Annotated[str, typer.Option(metavar="ADDRESS", help="where triplets are published")] = DEFAULT_PUBLISH,
    survey: SurveyOption = None,
    calibration: PosesOption = None,
    reliable: Annotated[bool, typer.Option("--reliable", help="the address is that of svev replay --reliable")] = False,
    bind_to: Annotated[
        str, typer.Option("--bind", metavar="ADDRESS", help="where to publish what is measured")
    ] = "tcp://127.0.0.1:5557",
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="folder for a file RECORDING-N.json of each measured jump"),
    ] = None,
    idle: Annotated[
        float | None, typer.Option(metavar="S", min=0.5, help="end when nothing has come for so long; else by Ctrl-C")
    ] = None,
    curve_public_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="public key of the publisher (svev keys)")
    ] = None,
    as_json: AlsoJson = False,
) -> None:
    """Measure the jumper in every triplet that comes, and each jump as a whole when it is over.

    Publishes [jumper, JSON] for every measured pulse (svev.JumperState) and [jumper/jump, JSON] for every jump
    (svev-jumper/1). Connects to a running recording or to svev replay. With --reliable several workers share a replay:
    each pulse is measured by one of them.

    Exit codes: 0; 2 bad input, or the address cannot be used; 4 the disk refuses.

    Example: svev worker --connect tcp://127.0.0.1:5556 --survey survey.json
    """
    source = Source(connect, reliable, None if curve_public_key is None else public_key(curve_public_key))
    with zmq.Context() as context, context.socket(zmq.PUB) as socket:
        socket.linger = _LINGER_MS
        address = bind(socket, bind_to)
        findings = _Published(socket, out, aside=as_json)
        with LiveAnalysis(survey, calibration, findings) as analysis, counted_endings() as asks:
            console.say(f"triplets from {connect}, results at {address}; end with Ctrl-C", aside=True)
            _work(analysis, source, idle, asks)
    summary = {"pulses": analysis.pulses, "states": findings.states, "jumps": analysis.jumps}
    if not reliable:  # of a reliable replay, other workers may have the pulses between ours
        summary["missed"] = analysis.missed
    if as_json:
        console.print_json(summary)
    else:
        console.say(", ".join(f"{count} {name}" for name, count in summary.items()))


def _work(analysis: LiveAnalysis, source: Source, idle_s: float | None, asks: Callable[[], int]) -> None:
    """Take triplets until told to end, or until nothing has come for so long."""
    with connected(source) as stream:
        quiet_s = 0.0
        while not asks() and (idle_s is None or quiet_s < idle_s):
            received = stream.next(_POLL_S)
            if received is not None:
                quiet_s = 0.0
                analysis.take(received)
            else:
                quiet_s += _POLL_S
                analysis.idle(quiet_s)


class _Published:
    """Publishes what is found, tells it on the terminal, and writes whole jumps into a folder.

    Attributes:
        states: number of measured pulses.
    """

    def __init__(self, socket: "zmq.Socket[bytes]", folder: Path | None, *, aside: bool) -> None:
        self._socket, self._folder, self._aside = socket, folder, aside
        self.states = 0

    def state(self, state: JumperState) -> None:
        """Publish a measured pulse."""
        self.states += 1
        self._socket.send_multipart([_TOPIC, state.encode()], zmq.DONTWAIT)

    def scene(self, recording: str, pulse: PulseNumber, time: UtcNs, scene: bytes) -> None:
        """The scene is for logs only."""

    def cameras(self, recording: str, pulse: PulseNumber, time: UtcNs, frames: bytes) -> None:
        """So is where the cameras stand in it."""

    def oriented(self, recording: str, time: UtcNs, scene: OrientedScene) -> None:
        """Whoever aims the cameras asks the service, which has an analysis of its own."""

    def jump(self, jump: MeasuredJump) -> None:
        """Publish a whole jump, and write it."""
        self._socket.send_multipart([_JUMP_TOPIC, json.dumps(result_file.to_json(jump.result)).encode()], zmq.DONTWAIT)
        console.say(f"jump {jump.summary.jump} of {jump.summary.recording}: {jump.summary.verdict}", aside=self._aside)
        if self._folder is None:
            return
        path = self._folder / f"{jump.summary.recording}-{jump.summary.jump}.json"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            result_file.write(jump.result, path)
        except OSError as error:
            raise StorageError(f"{path}: cannot be written ({error.strerror}); choose another folder") from error

    def message(self, level: Level, said: Phrase) -> None:
        """Say what people should know."""
        console.say(f"{_MARKS.get(level, '')}{said}", aside=True)
