"""Has the cameras found, and shows a picture of each on a page of its own."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import IO, Final

from rig.transport.process_table import Child, ProcessSpec
from svev.setup.looking import NoFireWire, Search, Seen

#: A camera that hangs is given up after so long, s.
_SILENCE_S: Final = 30.0
_PAGE: Final = "index.html"
_HEAD: Final = """<!doctype html><meta charset="utf-8"><title>Svev</title>
<style>body{font:18px sans-serif;margin:1rem;background:Canvas;color:CanvasText;color-scheme:light dark}
ol{display:flex;flex-wrap:wrap;gap:1rem;list-style:none;padding:0}li{max-width:30rem}img{width:100%}
b{font-size:2.5rem}</style><h1>Svev</h1><ol>
"""


@dataclass(frozen=True, slots=True)
class Found:
    """What a search found.

    Attributes:
        cameras: that answered.
        firewire: why there is no FireWire camera; empty if there are, or nobody has looked.
        problem: why the search ended early; empty: it did not.
        page: with the pictures; None: there are none.
    """

    cameras: tuple[Seen, ...]
    firewire: str = ""
    problem: str = ""
    page: Path | None = None


@contextmanager
def pictures() -> Iterator[Path]:
    """A folder for pictures, which everybody of this computer may look at while it is there."""
    with tempfile.TemporaryDirectory(prefix="svev-setup-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        yield folder


def search(folder: Path, network: str, addresses: tuple[str, ...] | None, firewire: bool) -> Found:
    """Find cameras and take a picture with each.

    Args:
        folder: for the pictures and their page.
        network: look for GigE Vision cameras in this network only, e.g. 192.168.11.0/24; "": everywhere.
        addresses: ask these GigE Vision cameras instead; None: look for all.
        firewire: whether to look for FireWire cameras.
    """
    config = Search(folder=str(folder), network=network, addresses=addresses, firewire=firewire)
    cameras: list[Seen] = []
    firewire_why = problem = ""
    with tempfile.TemporaryFile() as output:
        child = Child(
            ProcessSpec(
                "camera search", "svev.setup.looking", config, reports=Seen | NoFireWire, output=output, own_group=True
            )
        )
        try:
            while (message := child.control.next(_SILENCE_S)) is not None:
                if isinstance(message, Seen):
                    cameras.append(message)
                else:
                    firewire_why = message.why
            if not (child.control.ended and child.wait(_SILENCE_S)):
                problem = f"a camera has not answered for {_SILENCE_S:g} s; switch it off and on"
            elif child.ending() != "exit code 0":
                problem = _last_line(output)
        finally:
            child.kill()
    page = _write_page(folder, cameras) if any(each.picture for each in cameras) else None
    return Found(tuple(cameras), firewire_why, problem, page)


def _write_page(folder: Path, cameras: list[Seen]) -> Path:
    page = folder / _PAGE
    shown = [
        f"<li><b>{number}</b> {escape(each.what)}<br>"
        + (f'<img src="{Path(each.picture).name}" alt="">' if each.picture else escape(each.why))
        for number, each in enumerate(cameras, start=1)
    ]
    page.write_text(f"{_HEAD}{chr(10).join(shown)}\n</ol>\n", encoding="utf-8")
    return page


def _last_line(output: IO[bytes]) -> str:
    output.seek(0)
    lines = output.read().decode("utf-8", "replace").strip().splitlines()
    return lines[-1] if lines else "no reason given"
