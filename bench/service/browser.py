"""A browser without a window that says how long it takes until a page is drawn: Chromium's headless shell.

It is spoken to by the DevTools protocol, JSON that ends in a zero byte, over two pipes.
"""

import fcntl
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from rig.errors import ProcessDiedError

_PROGRAM: Final = "chromium-headless-shell"
_END_S: Final = 10.0
#: The shell (bash, since others know no larger numbers) puts the pipes where Chromium looks for them: 3 and 4.
_FREE: Final = 10
_PIECE: Final = 1 << 16
_DRAWN: Final = """new Promise((drawn) => {
  const look = () => {
    if (!(%s)) return setTimeout(look, 2);
    requestAnimationFrame(() => setTimeout(() => drawn(performance.now())));
  };
  look();
})"""


@dataclass(frozen=True, slots=True)
class Drawn:
    """How a page came to be drawn.

    Attributes:
        ms: since the browser went to its address.
        cpu_ms: that the page's thread computed: scripts, styles, layout.
    """

    ms: float
    cpu_ms: float


class Browser:
    """A running browser; see `browser`."""

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers, self._said, self._number = commands, answers, b"", 0

    def drawn(self, address: str, ready: str) -> Drawn:
        """Open a page that was never seen before, in a window for a laptop.

        Args:
            address: of the page.
            ready: JavaScript that is true once everything is on the page.

        Raises:
            ProcessDiedError: the browser has ended, or the page cannot be opened.
        """
        context = self._call("Target.createBrowserContext")["browserContextId"]
        window = {"url": "about:blank", "browserContextId": context, "width": 1280, "height": 800}
        target = self._call("Target.createTarget", window)["targetId"]
        session = self._call("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        self._call("Performance.enable", {}, session)
        went = self._call("Page.navigate", {"url": address}, session)
        if "errorText" in went:
            raise ProcessDiedError(f"{address}: {went['errorText']}")
        waiting = {"expression": _DRAWN % ready, "awaitPromise": True, "returnByValue": True}
        ms = self._call("Runtime.evaluate", waiting, session)["result"]["value"]
        metrics = {each["name"]: each["value"] for each in self._call("Performance.getMetrics", {}, session)["metrics"]}
        self._call("Target.disposeBrowserContext", {"browserContextId": context})
        return Drawn(ms, metrics["TaskDuration"] * 1e3)

    def _call(self, method: str, parameters: dict[str, Any] | None = None, session: str | None = None) -> Any:
        self._number += 1
        order = {"id": self._number, "method": method, "params": parameters or {}}
        if session is not None:
            order["sessionId"] = session
        os.write(self._commands, json.dumps(order).encode() + b"\0")
        while True:
            answer = json.loads(self._next())
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise ProcessDiedError(f"{_PROGRAM}: {method}: {answer['error']['message']}")
                return answer["result"]

    def _next(self) -> bytes:
        while b"\0" not in self._said:
            piece = os.read(self._answers, _PIECE)
            if not piece:
                raise ProcessDiedError(f"{_PROGRAM} has ended")
            self._said += piece
        message, _, self._said = self._said.partition(b"\0")
        return message


@contextmanager
def browser() -> Iterator[Browser | None]:
    """A browser; None if the computer has none."""
    program = shutil.which(_PROGRAM)
    if program is None:
        yield None
        return
    # Its helpers write there until they notice that it has ended.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        theirs, commands, answers, ours = _pipes()
        arguments = [f"--user-data-dir={profile}", "--remote-debugging-pipe", "--disable-gpu", "about:blank"]
        if os.geteuid() == 0:
            arguments.insert(0, "--no-sandbox")
        shell = ["/bin/bash", "-c", f'exec "$0" "$@" 3<&{theirs} 4>&{answers}', program, *arguments]
        with subprocess.Popen(shell, pass_fds=(theirs, answers), stderr=subprocess.DEVNULL) as child:
            os.close(theirs)
            os.close(answers)
            try:
                yield Browser(commands, ours)
            finally:
                os.close(commands)
                os.close(ours)
                child.terminate()
                child.wait(_END_S)


def _pipes() -> tuple[int, int, int, int]:
    """Ends of two pipes: where the browser reads commands and we write them, where it writes answers and we read."""
    ends = [*os.pipe(), *reversed(os.pipe())]
    moved = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, _FREE) for end in ends]
    for end in ends:
        os.close(end)
    return moved[0], moved[1], moved[2], moved[3]
