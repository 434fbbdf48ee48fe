"""What `verify` says of logs that are sound, partial, or wrong; the wrong ones are made with the mcap library."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.writer import CompressionType, IndexType, Writer
from mcap_protobuf.schema import register_schema

from recorder.checking.verify import VerifyReport, verify
from recorder.log.extent import extent
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.info import info
from rig.clocks import UtcNs
from rig.tag import TAG_SCHEMA, TripletTag
from svev.cli import main
from tests.recorder.logs import (
    ABSENT,
    ALL_OK,
    DAMAGED,
    LOST,
    OK,
    READY_NS,
    SHAPE,
    make_image,
    make_tag,
    open_writer,
    write_log,
    write_pulse,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Pulse:
    """One pulse of a log made with the mcap library; None leaves a message out."""

    tag: TripletTag | None
    image: RawImage | None
    sequence: int

    @classmethod
    def make(cls, pulse: int, statuses: Any = ALL_OK) -> "Pulse":
        tag = make_tag(pulse, statuses)
        image = RawImage(
            width=tag.shape[1], height=tag.shape[0], step=tag.shape[1], encoding="mono8", frame_id="triplet",
            data=make_image(tag).tobytes(),
        )  # fmt: skip
        image.timestamp.FromNanoseconds(tag.time)
        return cls(tag, image, pulse)

    def change_image(self, **fields: Any) -> "Pulse":
        image = RawImage()
        image.CopyFrom(self.image)
        for name, value in fields.items():
            setattr(image, name, value)
        return replace(self, image=image)


def _write(path: Path, pulses: list[Pulse], **options: Any) -> Path:
    """A log of profile svev by another writer."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, **options)
        writer.start(profile="svev", library="test")
        image_schema = register_schema(writer, RawImage)
        tag_schema = writer.register_schema("svev.TripletTag", "jsonschema", json.dumps(TAG_SCHEMA).encode())
        images = writer.register_channel("/triplet", "protobuf", image_schema)
        tags = writer.register_channel("/triplet/tag", "json", tag_schema)
        writer.register_channel("/events", "protobuf", register_schema(writer, Log))
        for pulse in pulses:
            time = pulse.tag.time if pulse.tag else make_tag(pulse.sequence).time
            if pulse.tag is not None:
                writer.add_message(tags, time + READY_NS, pulse.tag.encode(), time, pulse.sequence)
            if pulse.image is not None:
                writer.add_message(images, time + READY_NS, pulse.image.SerializeToString(), time, pulse.sequence)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _verify(tmp_path: Path, *pulses: Pulse, **options: Any) -> VerifyReport:
    return verify(_write(tmp_path / "log.mcap", list(pulses), **options))


def test_a_log_with_a_pause_is_not_clean_though_every_pulse_is_complete(tmp_path: Path) -> None:
    pulses = [Pulse.make(pulse) for pulse in range(1, 11)]
    shifted = [msgspec.structs.replace(make_tag(n), time=UtcNs(make_tag(n + 99).time)) for n in range(11, 21)]
    report = _verify(tmp_path, *pulses, *(Pulse(tag, None, tag.pulse) for tag in shifted))
    assert report.ledger.complete == 20
    assert [(pause.after_pulse, pause.pulses, pause.idle) for pause in report.ledger.pauses()] == [
        (10, 99, ("K1", "K2", "K3"))
    ]
    assert "no pulses for 3.33 s after pulse 10" in " ".join(report.ledger.in_words())


@pytest.mark.parametrize(("end", "verdict"), [(5, "clean"), (8, "partial")])
def test_a_log_without_pulses_before_its_end_is_not_clean(tmp_path: Path, end: int, verdict: str) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        for pulse in range(1, 6):
            write_pulse(log, buffers, make_tag(pulse))
        log.set_metadata("svev.recording", extent(make_tag(1).time, make_tag(end).time))
    buffers.close()
    for found in (verify(tmp_path / "log.mcap"), info(tmp_path / "log.mcap")):
        assert len(found.ledger.pauses()) == (verdict == "partial")
        assert len(found.to_json()["pauses"]) == (verdict == "partial")
    assert verify(tmp_path / "log.mcap").verdict == verdict


def test_a_complete_log_is_clean(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 5)
    read: list[int] = []
    report = verify(tmp_path / "log.mcap", read.append)
    assert (report.verdict, report.closed, report.findings) == ("clean", True, ())
    assert [event.message for event in report.events] == ["recording started", "recording stopped"]
    assert read == sorted(read)
    assert read[-1] == (tmp_path / "log.mcap").stat().st_size - 8  # all but the closing magic
    assert report.to_json() | {"events": []} == {
        "log": str(tmp_path / "log.mcap"), "verdict": "clean", "closed": True, "truncated": False,
        "being_written": False,
        "every_byte_checked": True, "pulses": 5, "complete": 5, "partial": 0,
        "causes": {"lost": 0, "missed": 0, "damaged": 0, "absent": 0}, "bytes": (tmp_path / "log.mcap").stat().st_size,
        "missing_pulses": [], "incomplete_pulses": [], "pauses": [], "ended_early": "",
        "part_before": "", "part_after": "", "off_time": [], "misfiled": [], "findings": [], "events": [],
    }  # fmt: skip


def test_a_log_without_a_checksum_over_everything_is_read_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As earlier versions wrote them."""
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK,) * 2)
    data = bytearray(path.read_bytes())
    end = data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")
    data[end + 9 : end + 13] = bytes(4)
    path.write_bytes(data)
    report = verify(path)
    assert (report.verdict, report.findings, report.every_byte) == ("clean", (), False)
    assert main(["verify", str(path)]) == 0
    assert "no checksum over the whole log" in capsys.readouterr().out


def test_a_log_that_does_not_say_where_its_data_ends_is_named(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK,) * 2)
    data = bytearray(path.read_bytes())
    data[data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")] = 0x80
    path.write_bytes(data)
    assert verify(path).findings == ("the log does not say where its data ends",)


def test_a_partial_log_says_per_pulse_what_is_missing(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK, (OK, LOST, OK), (OK, LOST, OK), (ABSENT, OK, DAMAGED), (ABSENT,) * 3))
    report = verify(tmp_path / "log.mcap")
    assert (report.verdict, report.findings) == ("partial", ())
    assert list(report.ledger.in_words()) == [
        "pulses 2-3: K2 lost",
        "pulse 4: K1 absent, K3 damaged",
        "pulse 5: K1 absent, K2 absent, K3 absent",
    ]
    found = report.to_json()
    assert (found["complete"], found["partial"]) == (1, 4)
    assert found["causes"] == {"lost": 2, "missed": 0, "damaged": 1, "absent": 4}
    assert found["incomplete_pulses"][0] == {"pulse": 2, "cameras": {"K2": "lost"}}


def test_a_log_of_another_writer_is_understood(tmp_path: Path) -> None:
    report = _verify(tmp_path, *(Pulse.make(pulse) for pulse in (1, 2, 3)))
    assert (report.verdict, report.findings, report.ledger.pulses) == ("clean", (), 3)


@pytest.mark.parametrize(("pulses", "missing"), [((1, 2, 5), [3, 4]), ((3, 4), [1, 2]), ((1, 3, 5), [2, 4])])
def test_gaps_are_damage(tmp_path: Path, pulses: tuple[int, ...], missing: list[int]) -> None:
    report = _verify(tmp_path, *(Pulse.make(pulse) for pulse in pulses))
    assert report.verdict == "damaged"
    assert report.to_json()["missing_pulses"] == missing


@pytest.mark.parametrize(
    ("change", "finding"),
    [
        (lambda p: replace(p, image=None), "pulse 2: its tag says that frames came, but there is no image"),
        (lambda p: replace(p, sequence=7), "pulse 2: its tag stands in the message of pulse 7"),
        (lambda p: p.change_image(width=45, step=45), "pulse 2: its image is 24 x 45, its tag says 24 x 90"),
        (lambda p: p.change_image(encoding="rgb8"), 'pulse 2: the image is "rgb8"'),
        (lambda p: p.change_image(data=b"short"), "pulse 2: the image has 5 pixels instead of 2160"),
        (
            lambda p: replace(p, tag=make_tag(2, (OK, LOST, OK))),
            "pulse 2: K2 is lost, but its block of the image is not",
        ),
        (
            lambda p: replace(p, tag=msgspec.structs.replace(p.tag, time=UtcNs(5))),
            "pulse 2: it is not later than the pulse before it",
        ),
        (
            lambda p: replace(p, tag=msgspec.structs.replace(p.tag, cameras=p.tag.cameras[:2])),
            "pulse 2: its tag names other cameras or columns",
        ),
        (
            lambda p: replace(p, tag=msgspec.structs.replace(p.tag, shape=(24, 120))),
            "pulse 2: its cameras' columns do not lie",
        ),
    ],
)
def test_contradictions_are_named(tmp_path: Path, change: Callable[[Pulse], Pulse], finding: str) -> None:
    report = _verify(tmp_path, Pulse.make(1), change(Pulse.make(2)), Pulse.make(3))
    assert report.verdict == "damaged"
    assert any(text.startswith(finding) for text in report.findings), report.findings


def test_an_image_without_a_tag_is_named(tmp_path: Path) -> None:
    report = _verify(tmp_path, Pulse.make(1), replace(Pulse.make(2), tag=None), Pulse.make(3))
    assert "pulse 2: it has an image, but no tag before it" in report.findings
    assert report.ledger.missing == [(2, 2)]


def test_a_pulse_that_is_tagged_twice_is_named(tmp_path: Path) -> None:
    report = _verify(tmp_path, Pulse.make(1), Pulse.make(2), Pulse.make(2), Pulse.make(3))
    assert "pulse 2: tagged a second time, or out of order" in report.findings
    assert report.ledger.pulses == 3


def test_a_tag_that_contradicts_itself_is_named(tmp_path: Path) -> None:
    pulse = Pulse.make(1)
    assert pulse.tag is not None
    lying = json.loads(pulse.tag.encode()) | {"complete": False}
    with (tmp_path / "lying.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="svev")
        schema = writer.register_schema("svev.TripletTag", "jsonschema", b"{}")
        tags = writer.register_channel("/triplet/tag", "json", schema)
        writer.add_message(tags, pulse.tag.time, json.dumps(lying).encode(), pulse.tag.time, 1)
        writer.add_message(tags, pulse.tag.time, b'{"pulse": 2}', pulse.tag.time, 2)
        writer.finish()  # type: ignore[no-untyped-call]
    findings = verify(tmp_path / "lying.mcap").findings
    assert 'pulse 1: its tag says "complete", its cameras say otherwise' in findings
    assert any(finding.startswith("pulse 2: its tag cannot be read") for finding in findings)


@pytest.mark.parametrize(
    ("options", "finding"),
    [
        ({"index_types": IndexType.ALL & ~IndexType.CHUNK}, "the summary has 0 of 1 chunk indexes"),
        ({"repeat_channels": False}, "the summary has 0 of 3 channels"),
    ],
)
def test_a_summary_that_lacks_something_is_named(tmp_path: Path, options: dict[str, Any], finding: str) -> None:
    assert finding in _verify(tmp_path, Pulse.make(1), Pulse.make(2), **options).findings


def test_a_log_without_chunks_is_named(tmp_path: Path) -> None:
    report = _verify(tmp_path, Pulse.make(1), use_chunking=False)
    assert any("stands outside of a chunk" in finding for finding in report.findings)


def test_a_compressed_log_is_named_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="svev")
        tags = writer.register_channel("/triplet/tag", "json", 0)
        writer.add_message(tags, 1, make_tag(1).encode() * 100, 1, 1)
        writer.finish()  # type: ignore[no-untyped-call]
    assert any("it is compressed; rewrite the log with `mcap decompress`" in text for text in verify(path).findings)


def test_black_blocks_are_looked_at_pixel_by_pixel(tmp_path: Path) -> None:
    pulse = Pulse.make(1, (OK, LOST, OK))
    assert pulse.image is not None
    pixels = np.frombuffer(pulse.image.data, np.uint8).reshape(24, 90).copy()
    pixels[23, 59] = 1
    report = _verify(tmp_path, pulse.change_image(data=pixels.tobytes()))
    assert report.findings == ("pulse 1: K2 is lost, but its block of the image is not black",)
    pixels[23, 59], pixels[23, 60] = 0, 7
    report = _verify(tmp_path, pulse.change_image(data=pixels.tobytes()))
    assert (report.verdict, report.findings) == ("partial", ())
