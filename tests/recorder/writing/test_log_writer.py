"""What the writer writes, independent readers read: bit for bit."""

import errno
import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import tracemalloc
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import McapReader, NonSeekingReader, make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from recorder.checking.verify import verify
from recorder.log.mcap_layout import PAGE
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.info import info
from recorder.writing.append_file import AppendFile
from rig.clocks import UtcNs
from rig.errors import BadInputError, StorageError
from rig.events import Event, Level
from rig.jumper import JumperState
from rig.topics import JUMPER, JUMPER_SCENE, RIG_METADATA, SESSION_METADATA
from rig.transport import wire
from tests.recorder.logs import (
    ALL_OK,
    DESCRIPTION,
    LOST,
    MISSED,
    OK,
    RIG,
    RIG_TOML,
    SESSION,
    START,
    Written,
    acquire,
    jumper_state,
    make_tag,
    open_writer,
    write_log,
    write_pulse,
)
from tests.support.waiting import wait_until

NPM = Path(__file__).parents[1] / "npm"
PULSES = (ALL_OK, (OK, LOST, OK), (MISSED,) * 3, ALL_OK, (OK, OK, LOST))


def _check(written: list[Written], reader: McapReader) -> None:
    images = {m.sequence: (m, image) for _, _, m, image in reader.iter_decoded_messages(topics=["/triplet"])}
    assert sorted(images) == [w.tag.pulse for w in written if w.image is not None]
    for w in written:
        if w.image is None:
            continue
        message, image = images[w.tag.pulse]
        assert (message.publish_time, message.log_time) == (w.tag.time, w.log_time)
        assert (image.height, image.width, image.step) == (*w.tag.shape, w.tag.shape[1])
        assert (image.encoding, image.frame_id) == ("mono8", "triplet")
        assert image.timestamp.ToNanoseconds() == w.tag.time
        assert np.array_equal(np.frombuffer(image.data, np.uint8).reshape(w.tag.shape), w.image)


def test_the_checksum_covers_every_byte_before_it(tmp_path: Path) -> None:
    """The mcap package checks it as it reads; and it is that of the bytes in the file."""
    path = tmp_path / "log.mcap"
    write_log(path, PULSES)
    with path.open("rb") as file:
        ends = [record for record in StreamReader(file, validate_crcs=True).records if isinstance(record, DataEnd)]
    data = path.read_bytes()
    end = data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")
    assert [record.data_section_crc for record in ends] == [zlib.crc32(data[:end])]


@pytest.mark.parametrize("shape", [(24, 90), (64, 192), (3, 3)])
def test_the_mcap_package_reads_every_bit(tmp_path: Path, shape: tuple[int, int]) -> None:
    path = tmp_path / "log.mcap"
    written = write_log(path, PULSES, shape)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        _check(written, reader)
        assert reader.get_header().profile == "svev"
        assert reader.get_header().library.startswith("svev ")
        tags = [json.loads(message.data) for _, _, message in reader.iter_messages(topics=["/triplet/tag"])]
        assert tags == [wire.to_builtins(w.tag) for w in written]
        assert {m.name: m.metadata for m in reader.iter_metadata()} == {"svev.session": SESSION, "svev.rig": RIG}
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("rig.toml", RIG_TOML)]
        events = [event for _, _, _, event in reader.iter_decoded_messages(topics=["/events"])]
        assert [(event.level, event.message) for event in events] == [
            (2, "recording started"),
            (2, "recording stopped"),
        ]
        assert events[0].timestamp.ToNanoseconds() == START


def test_the_stream_reader_sees_tag_then_image_pulse_by_pulse(tmp_path: Path) -> None:
    written = write_log(tmp_path / "log.mcap", PULSES)
    with (tmp_path / "log.mcap").open("rb") as file:
        messages = NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False)
        seen = [(channel.topic, message.sequence) for _, channel, message in messages]
    expected = []
    for w in written:
        expected += [("/triplet/tag", w.tag.pulse)] + [("/triplet", w.tag.pulse)] * (w.image is not None)
    assert [entry for entry in seen if entry[0].startswith("/triplet")] == expected


def test_tags_fit_the_schema_in_the_log(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", PULSES)
    with (tmp_path / "log.mcap").open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topics=["/triplet/tag"]):
            assert schema is not None
            assert (schema.name, schema.encoding) == ("svev.TripletTag", "jsonschema")
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))


def read_by_node(mode: str, path: Path) -> dict[str, Any]:
    """What the TypeScript library reads of a log, indexed or as a stream."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the second independent reader cannot run")
    if not (NPM / "node_modules").is_dir():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {NPM}, or `make test`")
    done = subprocess.run(
        [node, str(NPM / "read.mjs"), mode, str(path)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


_OWN_TOPICS = (("K1", (0, 64)), ("K2", (64, 128)), ("K3", (128, 192)))


@pytest.mark.parametrize("cameras", [(), _OWN_TOPICS], ids=["triplets", "cameras"])
@pytest.mark.parametrize("mode", ["indexed", "stream"])
def test_the_typescript_library_reads_every_bit(
    tmp_path: Path, mode: str, cameras: tuple[tuple[str, tuple[int, int]], ...]
) -> None:
    path = tmp_path / "log.mcap"
    written = write_log(path, PULSES, (64, 192), cameras)
    found = read_by_node(mode, path)
    assert found["profile"] == "svev"
    with path.open("rb") as file:
        expected = {
            (channel.topic, m.sequence, str(m.log_time), str(m.publish_time), hashlib.sha256(m.data).hexdigest())
            for _, channel, m in make_reader(file).iter_messages()
        }
    assert {tuple(message.values()) for message in found["messages"]} == expected
    tags = [m for m in found["messages"] if m["topic"] == "/triplet/tag"]
    assert [m["sequence"] for m in tags] == [w.tag.pulse for w in written]
    assert tags[0]["sha256"] == hashlib.sha256(written[0].tag.encode()).hexdigest()
    if mode == "indexed":
        images = {f"/camera/{name}": 4 for name, _ in cameras} or {"/triplet": 4}
        assert found["counts"] == {**images, "/triplet/tag": 5, "/events": 2, "/health": 1}
        assert found["metadata"] == [["svev.session", SESSION], ["svev.rig", RIG]]
        assert found["attachments"] == [["rig.toml", RIG_TOML.decode()]]


def test_pixels_stand_on_pages_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    written = write_log(path, (ALL_OK,) * 3, (64, 192))
    data = path.read_bytes()
    for w in written:
        assert w.image is not None
        assert data.find(w.image.tobytes()) % PAGE == 0


def test_a_tag_of_eight_cameras_fits(tmp_path: Path) -> None:
    buffers = TripletBuffers((8, 16), 1)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        written = write_pulse(log, buffers, make_tag(2**32 - 1, (OK,) * 8, (8, 16)))
    with (tmp_path / "log.mcap").open("rb") as file:
        _check([written], make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()]))


def test_a_tag_that_does_not_fit_is_refused_and_the_slot_is_free(tmp_path: Path) -> None:
    buffers = TripletBuffers((8, 16), 1)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        with pytest.raises(ValueError, match="does not fit"):
            log.write_pulse(make_tag(1), acquire(buffers), START, b"x" * 9000)
        assert buffers.free_count == 1
        write_pulse(log, buffers, make_tag(1, (OK,) * 2, (8, 16)))
    assert info(tmp_path / "log.mcap").messages["/triplet"] == 1


def test_the_log_says_what_it_is_before_the_first_pulse(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    buffers = TripletBuffers((8, 16), 1)
    log = open_writer(path, buffers, replace(DESCRIPTION, calibration_json=b"{}", calibrations={"K1": b""}))
    try:
        data = path.read_bytes()
        assert all(word in data for word in (b"svev.session", b"Anna Berg", b"svev.rig", RIG_TOML, b"calibration.json"))
    finally:
        log.close()
    with path.open("rb") as file:
        reader = make_reader(file)
        assert {a.name for a in reader.iter_attachments()} == {"rig.toml", "calibration.json"}
        assert [channel.topic for _, channel, _ in reader.iter_messages()] == ["/calibration/K1"]


def test_changed_session_fields_are_written_at_the_end(tmp_path: Path) -> None:
    buffers = TripletBuffers((8, 16), 1)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        log.set_metadata(SESSION_METADATA, SESSION | {"gate": "9"})
        log.set_metadata(RIG_METADATA, RIG)
    with (tmp_path / "log.mcap").open("rb") as file:
        records = [(m.name, m.metadata) for m in make_reader(file).iter_metadata()]
    assert records == [("svev.session", SESSION), ("svev.rig", RIG), ("svev.session", SESSION | {"gate": "9"})]


def test_events_and_health_are_in_the_file_within_a_second(tmp_path: Path) -> None:
    buffers = TripletBuffers((8, 16), 1)
    path = tmp_path / "log.mcap"
    with open_writer(path, buffers) as log:
        log.write_event(Event(START, Level.ERROR, "K2", "gone"))
        log.write_health(b'{"free":3}', START)
        wait_until(lambda: b'{"free":3}' in path.read_bytes() and b"gone" in path.read_bytes(), "both there", 1.0)


def test_results_stand_on_their_channels_under_the_number_of_their_pulse(tmp_path: Path) -> None:
    buffers = TripletBuffers((8, 16), 1)
    path, state = tmp_path / "log.mcap", jumper_state(94)
    with open_writer(path, buffers) as log:
        log.write_message(JUMPER.name, state.encode(), state.time, START, state.pulse)
        log.write_message(JUMPER_SCENE.name, SceneUpdate().SerializeToString(), state.time, START, state.pulse)
    with path.open("rb") as file:
        found = {channel.topic: (schema, message) for schema, channel, message in make_reader(file).iter_messages()}
    schema, message = found["/jumper"]
    assert (message.sequence, message.publish_time) == (94, state.time)
    assert schema is not None
    jsonschema.validate(json.loads(message.data), json.loads(schema.data))
    assert JumperState.decode(message.data) == state
    assert found["/jumper/scene"][1].sequence == 94
    assert verify(path).verdict == "clean"


def test_slots_come_back_only_when_nobody_else_holds_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    buffers = TripletBuffers((8, 16), 2)
    released: list[int] = []
    release = buffers.release

    def note(slot: int) -> None:
        release(slot)
        released.append(slot)

    monkeypatch.setattr(buffers, "release", note)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        slot = acquire(buffers)
        buffers.hold(slot)
        log.write_pulse(make_tag(1, (OK,) * 2, (8, 16)), slot, START)
        wait_until(lambda: released == [slot], "written")
        assert buffers.free_count == 1
        release(slot)
        assert buffers.free_count == 2


def test_a_log_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(BadInputError, match="exists already and is never overwritten; choose"):
        open_writer(path, TripletBuffers((8, 16), 1))
    assert path.read_bytes() == b"precious"


@pytest.mark.parametrize("place", ["nowhere/log.mcap", "file/log.mcap"])
def test_a_directory_that_is_none_is_named(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BadInputError, match="choose"):
        open_writer(tmp_path / place, TripletBuffers((8, 16), 1))


def test_writing_after_close_is_an_error(tmp_path: Path) -> None:
    buffers = TripletBuffers((8, 16), 1)
    log = open_writer(tmp_path / "log.mcap", buffers)
    log.close()
    assert log.close() == log.summary
    with pytest.raises(StorageError, match="closed"):
        log.write_event(Event(UtcNs(0), Level.INFO, "recorder", "too late"))
    with pytest.raises(StorageError, match="closed"):
        log.write_pulse(make_tag(1), acquire(buffers), START)
    assert buffers.free_count == 1


def test_memory_that_direct_writes_refuse_is_written_through_the_cache(tmp_path: Path) -> None:
    file = AppendFile(tmp_path / "file")
    direct = file.direct
    odd = memoryview(bytearray(2 * PAGE + 16))
    start = next(i for i in range(16) if np.frombuffer(odd[i:], np.uint8).ctypes.data % 16)
    odd[start : start + PAGE] = bytes(range(256)) * 16
    file.append(odd[start : start + PAGE])
    file.close()
    assert (tmp_path / "file").read_bytes() == bytes(range(256)) * 16
    if direct:
        assert not file.direct


def test_nothing_of_the_size_of_an_image_is_allocated_while_recording(tmp_path: Path) -> None:
    shape = (1216, 5808)
    buffers = TripletBuffers(shape, 3)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        tracemalloc.start()
        for pulse in range(1, 7):
            tag = make_tag(pulse, shape=shape)
            log.write_pulse(tag, acquire(buffers), tag.time)
        wait_until(lambda: buffers.free_count == 3, "all on disk")
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < shape[0] * shape[1] // 20


def test_a_file_system_without_direct_writes_is_noted_and_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = fcntl.fcntl

    def refuse(descriptor: int, command: int, argument: int = 0) -> int:
        if command == fcntl.F_SETFL and argument & os.O_DIRECT:
            raise OSError(errno.EINVAL, "no direct I/O here")
        return real(descriptor, command, argument)

    monkeypatch.setattr(fcntl, "fcntl", refuse)
    write_log(tmp_path / "log.mcap", PULSES)
    report = verify(tmp_path / "log.mcap")
    assert (report.verdict, report.findings) == ("partial", ())
    assert report.events[0].message == "the file system takes no direct I/O: writing costs more"


def test_a_disk_that_cannot_sync_ends_the_log_with_a_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    buffers = TripletBuffers((8, 16), 2)
    log = open_writer(tmp_path / "log.mcap", buffers)
    monkeypatch.setattr(os, "fdatasync", fail)
    write_pulse(log, buffers, make_tag(1, (OK, OK), (8, 16)))
    wait_until(lambda: log._thread.error is not None, "the first sync, a second after the first write")
    with pytest.raises(StorageError, match=r"log\.mcap: the disk fails: look at `dmesg`"):
        write_pulse(log, buffers, make_tag(2, (OK, OK), (8, 16)))
    assert log.abandon() == log.summary
    wait_until(lambda: buffers.free_count == 2, "all slots are free")
    assert verify(tmp_path / "log.mcap").closed


def test_an_unforeseen_error_in_the_write_thread_is_told_and_all_buffers_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("nobody foresaw this")

    buffers = TripletBuffers((8, 16), 4)
    log = open_writer(tmp_path / "log.mcap", buffers)
    write_pulse(log, buffers, make_tag(1, (OK, OK), (8, 16)))
    wait_until(lambda: log.pulses == 1, "the first pulse is in the file")
    monkeypatch.setattr(log._index, "add_chunk", fail)
    for pulse in (2, 3, 4):
        with suppress(StorageError):
            write_pulse(log, buffers, make_tag(pulse, (OK, OK), (8, 16)))
    wait_until(lambda: log.over, "the thread has ended")
    with pytest.raises(StorageError, match=r"writing ended by RuntimeError: nobody foresaw this.*report this"):
        write_pulse(log, buffers, make_tag(5, (OK, OK), (8, 16)))
    assert buffers.free_count == 4
    assert log.pulses == 1
    assert "nobody foresaw this" in capfd.readouterr().err
    assert verify(tmp_path / "log.mcap").ledger.pulses >= 1
