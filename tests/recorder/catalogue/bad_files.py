"""A folder with one good log, and one of everything bad that may lie beside it under the name of a recording."""

import os
from pathlib import Path

from mcap.opcode import Opcode

from recorder.log.mcap_layout import MAGIC, TAG_CHANNEL, chunk_of_one
from rig.clocks import UtcNs
from tests.recorder.logs import ALL_OK, make_tag, write_log

GOOD = "good"
_TIB = 1 << 40
_SESSIONS: dict[str, bytes] = {
    "deep": b"[" * 200_000,
    "deep_inside": b'{"athlete": ' + b"[" * 200_000 + b"]" * 200_000 + b"}",
    "large": b'{"notes": "' + b"x" * 5_000_000 + b'"}',
    "digits": b'{"bib": ' + b"9" * 10_000 + b"}",
    "surrogate": b'{"athlete": "\\udc80 \\ud800 x"}',
    "latin": '{"athlete": "Bjørge"}'.encode("latin-1"),
}


def write_bad_files(folder: Path) -> set[str]:
    """Fill the folder.

    Returns:
        The ids of the bad files; the good one is `GOOD`.
    """
    write_log(folder / f"{GOOD}.mcap", (ALL_OK,) * 6)
    data = (folder / f"{GOOD}.mcap").read_bytes()
    files = {
        "zero": b"",
        "foreign": b"RIFF....AVI ",
        "text": b"wind from the left\n" * 1000,
        "other_profile": data.replace(b"\x04\x00\x00\x00svev", b"\x04\x00\x00\x00swev", 1),
        "headless": bytes(4096) + data[4096:],
        "beheaded": data[:20],
        "far_future": _with_tag(data, time_ns="9" * 40),
        "deep_tag": _with_tag(data, more='"x":' + "[" * 100_000 + "]" * 100_000 + ","),
    }
    for name, content in files.items():
        (folder / f"{name}.mcap").write_bytes(content)
    for name, size in (("sparse", _TIB), ("sparse_chunk", 1 << 30)):
        with (folder / f"{name}.mcap").open("wb") as file:
            file.write(_head(data))
            if name == "sparse_chunk":
                room = size - file.tell()
                file.write(_chunk_of_zeros(room))
            file.truncate(size)
    (folder / "directory.mcap").mkdir()
    os.mkfifo(folder / "pipe.mcap")
    (folder / "dangling.mcap").symlink_to("nowhere.mcap")
    (folder / "loop.mcap").symlink_to("loop.mcap")
    for name, text in _SESSIONS.items():
        write_log(folder / f"{name}.mcap", (ALL_OK,))
        (folder / f"{name}.session.json").write_bytes(text)
    write_log(folder / "session_pipe.mcap", (ALL_OK,))
    os.mkfifo(folder / "session_pipe.session.json")
    write_log(folder / "session_folder.mcap", (ALL_OK,))
    (folder / "session_folder.session.json").mkdir()
    links = {"directory", "pipe", "dangling", "loop"}
    return {*files, "sparse", "sparse_chunk", *links, *_SESSIONS, "session_pipe", "session_folder"}


def _head(log: bytes) -> bytes:
    """What stands before the first chunk: magic, header, schemas, channels, padding."""
    position = len(MAGIC)
    while log[position] != Opcode.CHUNK:
        position += 9 + int.from_bytes(log[position + 1 : position + 9], "little")
    return log[:position]


def _with_tag(log: bytes, time_ns: str = "", more: str = "") -> bytes:
    """A log whose only pulse has this time, or more in its tag."""
    tag = make_tag(1).encode().decode()
    if time_ns:
        tag = tag.replace(str(make_tag(1).time), time_ns, 1)
    tag = "{" + more + tag[1:]
    chunk, _ = chunk_of_one(TAG_CHANNEL, 1, tag.encode(), UtcNs(1), UtcNs(1))
    return _head(log) + chunk


def _chunk_of_zeros(room: int) -> bytes:
    """The head of a chunk of `room` bytes, its own included."""
    size = room - 9 - 40
    return bytes([Opcode.CHUNK]) + (room - 9).to_bytes(8, "little") + bytes(16) + size.to_bytes(8, "little") + (
        bytes(4 + 4) + size.to_bytes(8, "little")
    )  # fmt: skip
