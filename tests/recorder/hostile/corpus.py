"""The hostile logs: each is made anew by its function, and always the same.

`python -m tests.recorder.hostile.corpus FOLDER` writes them all.
"""

import random
import struct
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, ChunkIndex, DataEnd, Footer, Header, Metadata, Statistics

from recorder.log.coded_image import CodedImage
from recorder.log.ffv1 import CODEC, Encoder
from recorder.log.mcap_layout import (
    EVENTS_CHANNEL,
    HEALTH_CHANNEL,
    MAGIC,
    TAG_CHANNEL,
    TRIPLET_CHANNEL,
    pixels_field,
    raw_image_prefix,
    records,
)
from recorder.log.session_changes import session_path
from rig.images.pixels import MONO8, Pixels
from tests.recorder.hostile.builder import Builder, chunk, event, image, message, record, text
from tests.recorder.logs import ALL_OK, SHAPE, START, make_tag, write_log

_DEEP: Final = 30_000
_ESCAPE: Final = "\x1b]0;owned\x07\x1b[31m\r\nK1\n\t\u202e"
_MB: Final = 1 << 20
_GB: Final = 1 << 30

#: Writes the log of this path.
Maker = Callable[[Path], None]


def _tags() -> Iterator[tuple[str, Builder]]:
    """Tags that no recorder writes."""
    deep_list, deep_object = "[" * _DEEP + "]" * _DEEP, '{"a":' * (_DEEP // 3) + "1" + "}" * (_DEEP // 3)
    for name, value in {"deep-list": deep_list, "deep-object": deep_object, "unclosed": "[" * _DEEP}.items():
        yield f"tag-{name}", Builder().odd_tag(value.encode())
        yield f"tag-unknown-key-{name}", Builder().tag_with(more=f"={value}")
        yield f"tag-cameras-{name}", Builder().odd_tag(b'{"pulse":2,"cameras":' + value.encode() + b"}")
    for name, value in {
        "nan": "NaN",
        "infinity": "Infinity",
        "1e999": "1e999",
        "minus-1e999": "-1e999",
        "1e308": "1e308",
    }.items():
        yield f"tag-offset-{name}", Builder().camera_with(offset_us=f"={value}")
        yield f"tag-pulse-{name}", Builder().tag_with(pulse=f"={value}")
    for pulse in ("0", "-1", str(1 << 32), str(1 << 64), "9" * 400, "9" * 20_000, "1.5", '"2"', "null", "true"):
        yield f"tag-pulse-{pulse[:24].strip(chr(34))}-{len(pulse)}", Builder().tag_with(pulse=f"={pulse}")
    for time in ("", "x", "-1", "0", "9" * 19, str(1 << 63), "9" * 30, "9" * 20_000, "\u0663"):
        yield f"tag-time-{time[:20].encode().hex()}-{len(time)}", Builder().tag_with(time_ns=time)
        yield f"tag-host-time-{time[:20].encode().hex()}-{len(time)}", Builder().camera_with(host_time_ns=time)
    for shape in (
        "0,0",
        "0,90",
        "24,0",
        "-1,-1",
        f"{1 << 40},{1 << 40}",
        "65536,65536",
        "1,1",
        "24",
        "24,90,3",
        f"{'9' * 400},1",
    ):
        yield f"tag-shape-{shape[:30]}-{len(shape)}", Builder().tag_with(shape=f"=[{shape}]")
    for columns in ("30,0", "-5,5", f"0,{1 << 50}", "0,0"):
        yield f"tag-columns-{columns}", Builder().camera_with(columns=f"=[{columns}]")
    yield "tag-no-cameras", Builder().tag_with(cameras=[])
    yield "tag-many-cameras", Builder().tag_with(cameras=[{"name": "", "columns": [0, 1], "status": "ok"}] * 1000)
    yield "tag-camera-escapes", Builder().camera_with(name=_ESCAPE)
    yield "tag-camera-surrogate", Builder().camera_with(name='="\\ud800"')
    yield "tag-camera-long", Builder().camera_with(name="K" * 50_000)
    yield "tag-session-long", Builder().tag_with(session="s" * 60_000)
    yield "tag-session-longer", Builder().tag_with(session="s" * 3_000_000)
    yield "tag-recording-escapes", Builder().tag_with(recording=_ESCAPE)
    yield "tag-status-escapes", Builder().camera_with(status=_ESCAPE)
    yield "tag-dtype", Builder().tag_with(dtype="float64")
    yield (
        "tag-numbers",
        Builder().camera_with(frame_id="=" + "9" * 4000, trigger_count=-5, stamped_pixels=[1 << 60] * 3),
    )
    good = make_tag(2).encode()
    for name, data in {
        "empty": b"", "garbage": bytes(range(256)), "not-utf8": good.replace(b"K1", b"\xff\xfe"), "cut": good[:-5],
        "more": good + b"{}", "twice": good + good, "bom": b"\xef\xbb\xbf" + good, "zeros": bytes(500), "null": b"null",
        "same-key": good[:-1] + b',"pulse":7}', "string": b'"' + b"x" * 60_000 + b'"',
    }.items():  # fmt: skip
        yield f"tag-{name}", Builder().odd_tag(data)
    only_odd = Builder()
    for number in range(1, 4):
        only_odd.pulse(
            number,
            make_tag(number).encode().replace(b"[24,90]", b"[0,0]"),
            image(number, height=0, width=0, step=0, data=b""),
        )
    yield "all-shapes-zero", only_odd
    long_tags = Builder()
    for number in range(1, 4):
        long_tags.pulse(number, make_tag(number).encode().replace(b"morning", b"m" * 20_000))
    yield "all-tags-too-long-to-be-written", long_tags


def _head(shape: tuple[int, int], kind: Pixels = MONO8) -> bytes:
    """The fields before the pixels of an image."""
    return raw_image_prefix(shape, make_tag(2).time, kind).removesuffix(pixels_field(shape, kind))


def _images() -> Iterator[tuple[str, Builder]]:
    """Images that no recorder writes."""
    changes: dict[str, dict[str, object]] = {
        "zero": {"height": 0, "width": 0, "step": 0, "data": b""}, "zero-height": {"height": 0},
        "zero-with-pixels": {"height": 0, "width": 0, "step": 0},
        "huge": {"height": 4_000_000_000, "width": 4_000_000_000},
        "no-pixels": {"data": b""}, "step-zero": {"step": 0}, "color": {"encoding": "rgb8"},
        "escapes": {"encoding": _ESCAPE},
    }  # fmt: skip
    for name, fields in changes.items():
        yield f"image-{name}", Builder().picture(image(2, **fields))
    for name, data in {
        "empty": b"", "garbage": bytes(range(256)), "endless-number": b"\xff" * 100, "group": b"\x0b" * 1000,
        "length": b"\x32" + b"\xff" * 8 + b"\x7f", "negative-time": b"\x0a\x0b\x08" + b"\xff" * 9 + b"\x01" + image(2),
        "endless-time": b"\x0a\x0a\x08" + b"\xff" * 8 + b"\x7f" + image(2), "tag-zero": b"\x02\x00" * 50,
    }.items():  # fmt: skip
        yield f"image-{name}", Builder().picture(data)
    black = np.zeros(SHAPE, np.uint8)
    sound = CodedImage(_head(SHAPE), CODEC, 0, Encoder(SHAPE, 1)(black))
    for name, coded in {
        "other-checksum": sound, "other-codec": replace(sound, codec="h264"), "no-pixels": replace(sound, coded=b""),
        "garbage": replace(sound, coded=bytes(range(256)) * 4), "no-head": replace(sound, head=b""),
        "other-kind": replace(sound, head=_head(SHAPE, Pixels("mono16", 12))),
        "large": replace(sound, head=_head((16_000, 16_000))),
        "huge": replace(sound, head=_head((4_000_000_000, 4_000_000_000))),
    }.items():  # fmt: skip
        yield f"coded-{name}", Builder().picture(coded.encode())
    data = sound.encode()
    yield "coded-cut", Builder().picture(data[: len(data) // 2])
    yield "coded-twice", Builder().picture(data + data)
    yield "image-alone", Builder().pulse(1).add(chunk(message(TRIPLET_CHANNEL, 2, image(2))))
    yield (
        "image-twice",
        Builder()
        .pulse(1)
        .add(chunk(message(TAG_CHANNEL, 2, make_tag(2).encode()) + message(TRIPLET_CHANNEL, 2, image(2)) * 2)),
    )
    yield "pulses-twice", Builder().pulse(1).pulse(2).pulse(2).pulse(1)
    yield "pulses-backwards", Builder().pulse(4).pulse(3).pulse(2).pulse(1)
    yield "pulse-four-billion", Builder().pulse(1).pulse((1 << 32) - 1)


def _small_messages() -> Iterator[tuple[str, Builder]]:
    """Events and health records that no recorder writes."""
    for level in (99, -1, 2_000_000_000):
        yield f"event-level-{level}", Builder().event(event() + b"\x10" + _varint(level))
    for name, data in {
        "escapes": event(message=_ESCAPE, name=_ESCAPE), "long": event(message="m" * 60_000),
        "garbage": bytes(range(256)),
        "too-long": event(message="m" * 200_000), "empty": b"", "not-utf8": b"\x1a\x02\xff\xfe",
        "far-future": event() + b"\x0a\x0a\x08" + b"\xff" * 8 + b"\x7f",
        "far-past": event() + b"\x0a\x0b\x08" + b"\x80" * 9 + b"\x01",
    }.items():  # fmt: skip
        yield f"event-{name}", Builder().event(data)
    many = Builder().pulse(1)
    for number in range(2000):
        many.add(chunk(message(EVENTS_CHANNEL, number, event(message=f"event {number} " + "x" * 100))))
    yield "events-many", many
    for name, data in {
        "deep": b"[" * _DEEP + b"]" * _DEEP, "unclosed": b'{"a":' * 10_000, "nan": b'{"a":NaN}',
        "infinity": b'{"a":1e999}',
        "not-json": b"\x00\xff", "long": b'"' + b"x" * 60_000 + b'"', "number": b"9" * 60_000,
        "too-long": b"[" + b"1," * 2_000_000 + b"1]",
    }.items():  # fmt: skip
        yield f"health-{name}", Builder().health(data)


def _structures() -> Iterator[tuple[str, Builder]]:
    """Records that contradict themselves or each other."""
    yield "chunk-length", Builder().pulse(1).add(record(Opcode.CHUNK, bytes(60), (1 << 63) - 1)).pulse(2)
    yield "chunk-size", Builder().pulse(1).add(chunk(b"", size=(1 << 64) - 41)).pulse(2)
    yield "chunk-empty", Builder().pulse(1).add(chunk(b"")).pulse(2)
    yield "chunk-of-zeros", Builder().pulse(1).add(chunk(bytes(5000))).pulse(2)
    yield (
        "chunk-in-chunk",
        Builder().pulse(1).add(chunk(chunk(chunk(message(TAG_CHANNEL, 2, make_tag(2).encode()))))).pulse(3),
    )
    yield "chunk-many-messages", Builder().pulse(1).add(chunk(message(HEALTH_CHANNEL, 1, b"") * 100_000)).pulse(2)
    yield "chunk-message-short", Builder().pulse(1).add(chunk(record(Opcode.MESSAGE, b"abc"))).pulse(2)
    yield "chunk-message-length", Builder().pulse(1).add(chunk(record(Opcode.MESSAGE, bytes(30), 1 << 60))).pulse(2)
    yield "chunk-unknown-channel", Builder().pulse(1).add(chunk(message(9999, 1, b"x"))).pulse(2)
    yield "chunk-zstd", Builder().pulse(1).add(chunk(bytes(100), compression="zstd")).pulse(2)
    yield "chunk-compression-escapes", Builder().pulse(1).add(chunk(bytes(100), compression=_ESCAPE)).pulse(2)
    yield (
        "messages-without-chunk",
        Builder().add(message(TAG_CHANNEL, 1, make_tag(1).encode()), message(TRIPLET_CHANNEL, 1, image(1))),
    )
    channels = Builder()
    for number in range(5, 10_000):
        channels.channel(number, f"/{number}")
    yield "channels-many", channels.pulse(1)
    yield (
        "channel-names",
        Builder()
        .channel(20, _ESCAPE)
        .channel(21, "x" * 200_000)
        .add(chunk(message(20, 1, b"") + message(21, 1, b"")))
        .pulse(1),
    )
    yield (
        "channel-changes",
        Builder().pulse(1).channel(TAG_CHANNEL, "/health").channel(TRIPLET_CHANNEL, "/triplet/tag").pulse(2),
    )
    yield "metadata-escapes", Builder().metadata("svev.session", athlete=_ESCAPE, bib="\x00")
    yield "metadata-long", Builder().metadata("svev.session", athlete="a" * 900_000)
    yield "metadata-lengths", Builder().pulse(1).add(record(Opcode.METADATA, text("svev.session") + b"\xff" * 8))
    many = Builder().pulse(1)
    for number in range(20_000):
        many.add(records(Metadata(f"svev.{number}", {})))
    yield "metadata-many", many
    for kind, lost in {
        "huge": "1-" + "9" * 30,
        "digits": "1-" + "9" * 10_000,
        "backwards": "9-2 x - 5-",
        "arabic": "\u0661-\u0665",
    }.items():
        yield f"recovery-{kind}", Builder().pulse(3).metadata("svev.recovery", lost_pulses=lost, source=_ESCAPE)
    attachments = Builder().pulse(1)
    for number in range(300):
        attachments.add(records(Attachment(START, START, f"{number}", "text/plain", b"x" * 1000)))
    yield "attachments-many", attachments
    yield (
        "attachment-name",
        Builder().pulse(1).add(records(Attachment(START, START, _ESCAPE * 1000, "x", b"y"))[:-1] + b"\x00"),
    )
    yield (
        "attachment-length",
        Builder()
        .pulse(1)
        .add(
            record(
                Opcode.ATTACHMENT,
                struct.pack("<QQ", 1, 1) + text("rig.toml") + text("") + struct.pack("<Q", 1 << 62) + bytes(8),
            )
        ),
    )
    yield "padding-many", Builder().add(record(0x80, b"") * 50_000).pulse(1)
    yield (
        "message-indexes",
        Builder().pulse(1).add(record(Opcode.MESSAGE_INDEX, struct.pack("<HI", 2, 160_000) + bytes(160_000)) * 20),
    )
    yield (
        "schema-long",
        Builder().add(record(Opcode.SCHEMA, struct.pack("<H", 9) + text("x" * 500_000) + text("") + bytes(4))).pulse(1),
    )
    yield "header-escapes", Builder(header=records(Header("svev", _ESCAPE))).pulse(1)
    yield "header-profile", Builder(header=records(Header(_ESCAPE, "x"))).pulse(1)
    yield "header-long", Builder(header=records(Header("x" * 60_000, "x"))).pulse(1)
    yield "header-lengths", Builder(header=record(Opcode.HEADER, b"\xff" * 8)).pulse(1)
    yield "header-missing", Builder(header=b"").pulse(1)
    yield "nothing-declared", Builder(declared=False).pulse(1)
    ends = {
        "no-data-end": records(Footer(0, 0, 0)), "two-data-ends": records(DataEnd(0), DataEnd(0), Footer(0, 0, 0)),
        "wrong-checksum": records(DataEnd(5), Footer(0, 0, 0)),
        "footer-lies": records(DataEnd(0), Footer(1 << 60, 1 << 61, 7)),
        "statistics-lie": records(DataEnd(0), _statistics(), Footer(0, 0, 0)),
        "chunk-index-lies": records(DataEnd(0), _chunk_index(), Footer(0, 0, 0)),
        "summary-garbage": records(DataEnd(0)) + record(Opcode.STATISTICS, b"\xff" * 9) + records(Footer(0, 0, 0)),
    }  # fmt: skip
    for name, end in ends.items():
        yield f"end-{name}", Builder().pulse(1).add(end, MAGIC)
    yield "footer-in-the-middle", Builder().pulse(1).add(records(DataEnd(0), Footer(0, 0, 0)), MAGIC).pulse(2)
    yield "footer-alone", Builder(header=b"", declared=False).add(records(Footer(0, 0, 0)), MAGIC)


def _sparse() -> Iterator[tuple[str, Builder]]:
    """Small files that claim to be large."""
    chunks, topics, tags, pads = Builder().pulse(1), Builder(), Builder().pulse(1), Builder()
    for _ in range(3):
        size = 250 * _MB
        chunks.add(record(Opcode.CHUNK, struct.pack("<QQQIIQ", START, START, size, 1, 0, size), 40 + size)).hole(size)
    yield "sparse-chunks", chunks.pulse(2)
    for opcode, name, size, count in (
        (Opcode.ATTACHMENT, "attachments", 60 * _MB, 12), (Opcode.METADATA, "metadata", 60 * _MB, 12),
        (Opcode.SCHEMA, "schemas", 60 * _MB, 12), (Opcode.HEADER, "headers", 60 * _MB, 12),
        (Opcode.SCHEMA, "small-schemas", 120 << 10, 500), (Opcode.MESSAGE_INDEX, "indexes", _MB, 200),
        (Opcode.STATISTICS, "statistics", 60 * _MB, 12),
    ):  # fmt: skip
        builder = Builder().pulse(1)
        for number in range(count):
            head = struct.pack("<QQ", 0, 0) + text(f"{number}") + text("") + struct.pack("<Q", size - 100)
            builder.add(record(opcode, head, size)).hole(size - len(head))
        yield f"sparse-{name}", builder.pulse(2)
    for number in range(250):
        head = struct.pack("<HHI", number + 5, 0, _MB - 32 - number)
        topics.add(record(Opcode.CHANNEL, head, _MB)).hole(_MB - len(head))
    yield "sparse-topics", topics.pulse(1)
    size = 200 * _MB
    for topic, channel in (
        ("tag", TAG_CHANNEL),
        ("event", EVENTS_CHANNEL),
        ("health", HEALTH_CHANNEL),
        ("image", TRIPLET_CHANNEL),
    ):
        head = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22 + size - 31, channel, 2, START, START)
        yield (
            f"sparse-{topic}-message",
            Builder()
            .pulse(1)
            .add(record(Opcode.CHUNK, struct.pack("<QQQIIQ", 0, 0, size, 0, 0, size) + head, 40 + size))
            .hole(size - len(head))
            .pulse(2),
        )
    for number in range(300):
        head = message(TAG_CHANNEL, number, b"")[:31]
        length = _MB
        tags.add(
            record(
                Opcode.CHUNK,
                struct.pack("<QQQIIQ", 0, 0, length, 0, 0, length) + struct.pack("<BQ", 5, length - 9) + head[9:],
                40 + length,
            )
        ).hole(length - 31)
    yield "sparse-tags", tags
    for _ in range(3000):
        pads.add(record(0x80, b"", 30_000)).hole(30_000)
    yield "sparse-padding", pads.pulse(1)
    yield "sparse-hole", Builder().pulse(1).hole(1024 * _GB).pulse(2)
    yield "sparse-end", Builder().pulse(1).hole(4096 * _GB)
    yield "sparse-beginning", Builder(header=b"", declared=False).hole(1024 * _GB).pulse(1)


def _sessions() -> Iterator[tuple[str, bytes]]:
    """Files of session changes."""
    yield "session-deep", b'{"athlete":' + b"[" * 50_000 + b"]" * 50_000 + b"}"
    yield "session-deepest", b"[" * 3_000_000
    yield "session-large", b'{"athlete":"' + b"x" * (5 * _MB) + b'"}'
    yield "session-numbers", b'{"bib":1e999,"gate":NaN}'
    yield "session-garbage", bytes(range(256))
    yield "session-escapes", b'{"athlete":"\\u001b[31m\\r\\n"}'
    yield "session-zeros", bytes(1000)


def _shaken(seed: int) -> Maker:
    """A sound log whose records are cut out, doubled, exchanged and changed at random."""

    def write(path: Path) -> None:
        write_log(path, (ALL_OK,) * 6)
        random_, data = random.Random(seed), bytearray(path.read_bytes())
        for _ in range(random_.randrange(1, 30)):
            begin = random_.randrange(len(data))
            length = random_.choice((1, 1, 8, 300, 9000))
            match random_.randrange(5):
                case 0:
                    data[begin] ^= 1 << random_.randrange(8)
                case 1:
                    del data[begin : begin + length]
                case 2:
                    data[begin:begin] = data[begin : begin + length]
                case 3:
                    other = random_.randrange(len(data))
                    data[begin : begin + length] = data[other : other + length]
                case 4:
                    data[begin : begin + length] = random_.choice((b"\xff", b"\x00", b"\x05")) * length
        path.write_bytes(data)

    return write


def _with_session(changes: bytes) -> Maker:
    def write(path: Path) -> None:
        write_log(path, (ALL_OK,) * 2)
        session_path(path).write_bytes(changes)

    return write


def _statistics() -> Statistics:
    return Statistics(
        attachment_count=5, channel_count=5, channel_message_counts={1: 1 << 60}, chunk_count=5, message_count=1 << 60,
        message_end_time=0, message_start_time=5, metadata_count=5, schema_count=5,
    )  # fmt: skip


def _chunk_index() -> ChunkIndex:
    return ChunkIndex(
        chunk_length=1 << 60, chunk_start_offset=1 << 60, compression=_ESCAPE, compressed_size=5, message_end_time=0,
        message_index_length=1 << 60, message_index_offsets={9: 9}, message_start_time=5, uncompressed_size=5,
    )  # fmt: skip


def _varint(number: int) -> bytes:
    number %= 1 << 64
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def corpus() -> dict[str, Maker]:
    """All hostile logs by name."""
    built = [*_tags(), *_images(), *_small_messages(), *_structures(), *_sparse()]
    makers: dict[str, Maker] = {name.replace("/", "_"): builder.write for name, builder in built}
    assert len(makers) == len(built)
    makers |= {name: _with_session(changes) for name, changes in _sessions()}
    return makers | {f"shaken-{seed}": _shaken(seed) for seed in range(40)}


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for log, make in corpus().items():
        make(folder / f"{log}.mcap")
