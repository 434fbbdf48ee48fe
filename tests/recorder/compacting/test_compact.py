"""Compacted logs: everything is there to the last bit, any reader reads them, and what is false is found."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from recorder.checking.verify import Verdict, verify
from recorder.compacting import compact as compacting
from recorder.compacting.compact import compact
from recorder.log.coded_image import CodedImage
from recorder.log.ffv1 import CODEC, Encoder
from recorder.log.mcap_layout import pixels_field, raw_image_prefix
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.coded_images import records_crc, with_images
from recorder.reading.info import info
from recorder.reading.items import Message
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import parts_of
from recorder.reading.triplets import stored_pulses, triplets
from recorder.recovering.recover import recover
from rig.clocks import UtcNs
from rig.errors import BadInputError, LogDamagedError, StorageError
from rig.frame import FrameStatus
from rig.images.pixels import MONO8, Pixels, Stored
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.topics import COMPACT_METADATA, RECOVERY_METADATA
from svev.cli import main
from tests.recorder.logs import (
    ABSENT,
    ALL_OK,
    LOST,
    OK,
    OWN_TOPICS,
    READY_NS,
    acquire,
    make_tag,
    open_writer,
    write_log,
)
from tests.recorder.split import split_log
from tests.recorder.writing.test_log_writer import read_by_node

JUMP = (ALL_OK, (OK, LOST, OK), (ABSENT,) * 3, ALL_OK, ALL_OK)
KINDS = {
    "mono8": MONO8,
    "mono12": Pixels("mono16", 12),
    "mono16": Pixels("mono16", 16),
    "mosaic": Pixels("bayer_rggb8"),
}


def messages_of(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    """All messages of a log as our reader gives them."""
    with LogReader(path) as reader:
        return [
            (message.topic, message.sequence, message.log_time, message.publish_time, bytes(message.data or b""))
            for chunk in reader.sound_chunks()
            for message in chunk.messages
        ]


def write_kind(path: Path, kind: Pixels, shape: tuple[int, int] = (37, 90)) -> None:
    """A log whose pixels take all values that they may, with edges and noise, even the largest."""
    buffers = TripletBuffers(shape, 4, (), kind)
    with open_writer(path, buffers) as log:
        for pulse in range(1, 4):
            tag = make_tag(pulse, shape=shape)
            tag = TripletTag.made(PulseNumber(pulse), tag.time, "s", "r", shape, tag.cameras, kind)
            image = np.random.default_rng(pulse).integers(0, 1 << kind.bits, shape).astype(kind.dtype)
            image[:, 45:] = (1 << kind.bits) - 1
            slot = acquire(buffers)
            buffers.write(slot, image)
            log.write_pulse(tag, slot, UtcNs(tag.time + READY_NS))
    buffers.close()


@pytest.mark.parametrize("cameras", [(), OWN_TOPICS], ids=["triplets", "cameras"])
def test_everything_is_there_to_the_last_bit(tmp_path: Path, cameras: tuple[tuple[str, tuple[int, int]], ...]) -> None:
    log, out = tmp_path / "jump.mcap", tmp_path / "out.mcap"
    write_log(log, JUMP, cameras=cameras)
    before = log.read_bytes()
    report = compact(log, out)
    assert log.read_bytes() == before
    assert messages_of(out) == messages_of(log)
    assert (report.ledger.pulses, report.bytes) == (5, out.stat().st_size)
    one, two = verify(log), verify(out)
    assert (two.verdict, two.ledger.counts(), two.every_byte) == (Verdict.PARTIAL, one.ledger.counts(), True)
    with LogReader(log) as reader, LogReader(out) as other:
        list(reader.items())
        list(other.items())
        assert other.attachments == reader.attachments
        said = other.metadata.pop(COMPACT_METADATA)
        assert other.metadata == reader.metadata
    assert (said["source"], said["bytes"], said["codec"]) == ("jump.mcap", str(len(before)), "ffv1")
    assert [tag.pulse for tag, where in _stored(out) if where] == [1, 2, 4, 5]


def _stored(path: Path) -> list[tuple[TripletTag, bool]]:
    """The pulses as they are found without reading pixels, and whether they have an image that can be read alone."""
    with LogReader(path, skim=True) as reader:
        found = list(stored_pulses(reader))
        return [(tag, stored is not None and stored.image(reader).shape == tag.shape) for tag, stored in found]


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_pixels_of_every_kind_come_back(tmp_path: Path, kind: Pixels) -> None:
    log, out = tmp_path / "jump.mcap", tmp_path / "out.mcap"
    write_kind(log, kind)
    compact(log, out)
    assert verify(out).verdict is Verdict.CLEAN
    pairs = zip(triplets(log), triplets(out), strict=True)
    assert all(np.array_equal(one[1], two[1]) and one[1].dtype == two[1].dtype for one, two in pairs)
    assert messages_of(out) == messages_of(log)


def test_any_reader_reads_it_and_ffmpeg_decodes_its_images(tmp_path: Path) -> None:
    log, out = tmp_path / "jump.mcap", tmp_path / "out.mcap"
    written = write_log(log, JUMP)
    compact(log, out)
    images = {}
    with out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, _, message, image in reader.iter_decoded_messages(topics=["/triplet"]):
            assert schema is not None
            assert schema.name == "svev.CodedImage"
            assert (image.encoding, image.codec, image.frame_id) == ("mono8", "ffv1", "triplet")
            decoder = av.CodecContext.create(image.codec, "r")
            decoder.width, decoder.height = image.width, image.height
            decoder.thread_count = 1
            images[message.sequence] = decoder.decode(av.Packet(image.coded))[0].to_ndarray()
    assert images.keys() == {1, 2, 4, 5}
    for pulse in written:
        if pulse.image is not None:
            np.testing.assert_array_equal(images[pulse.tag.pulse], pulse.image)


@pytest.mark.parametrize("mode", ["indexed", "stream"])
def test_the_typescript_library_reads_it(tmp_path: Path, mode: str) -> None:
    log, out = tmp_path / "jump.mcap", tmp_path / "out.mcap"
    write_log(log, JUMP)
    compact(log, out)
    found = read_by_node(mode, out)
    with out.open("rb") as file:
        expected = {
            (channel.topic, m.sequence, str(m.log_time), str(m.publish_time), hashlib.sha256(m.data).hexdigest())
            for _, channel, m in make_reader(file).iter_messages()
        }
    assert {tuple(message.values()) for message in found["messages"]} == expected
    assert len(expected) == len(messages_of(log))


def test_quiet_pictures_become_smaller(tmp_path: Path) -> None:
    """Noise of two grey values takes 3.05 bits of a pixel, so no coding makes less than 0.38 of it; ours comes near."""
    log, out = tmp_path / "jump.mcap", tmp_path / "out.mcap"
    shape = (240, 960)
    buffers = TripletBuffers(shape, 4)
    with open_writer(log, buffers) as writer:
        for pulse in range(1, 5):
            tag = make_tag(pulse, shape=shape)
            noise = np.random.default_rng(pulse).normal(np.linspace(80, 160, shape[1]), 2.0, shape)
            slot = acquire(buffers)
            buffers.write(slot, np.round(noise).astype(np.uint8))
            writer.write_pulse(tag, slot, UtcNs(tag.time + READY_NS))
    buffers.close()
    assert compact(log, out).ratio > 2.0


def _image_message(picture: Stored, recorded: Stored) -> Message:
    """A message whose coded pixels are those of one image, and whose checksum is that of another."""
    prefix = raw_image_prefix(recorded.shape, UtcNs(4))
    raw = prefix + recorded.tobytes()
    plain = Message("/triplet", 1, 7, UtcNs(5), UtcNs(4), 0, 0, len(raw), memoryview(raw))
    assert with_images([plain]) == ([plain], "")
    coded = CodedImage(
        prefix.removesuffix(pixels_field(recorded.shape, MONO8)),
        CODEC,
        records_crc([plain]),
        Encoder(picture.shape, 1)(picture),
    ).encode()
    return replace(plain, data=memoryview(coded))


def test_a_frame_is_what_the_recorder_had_or_it_is_said(tmp_path: Path) -> None:
    picture = np.random.default_rng(1).integers(0, 256, (24, 30), dtype=np.uint8)
    other = picture.copy()
    other[3, 4] ^= 1
    assert with_images([_image_message(picture, picture)])[1] == ""
    assert "the checksum of the recorder is not theirs" in with_images([_image_message(other, picture)])[1]
    sound = _image_message(picture, picture)
    for data in (bytes(sound.data or b"")[:-40], bytes(sound.data or b"").replace(b"ffv1", b"ffv9")):
        assert with_images([replace(sound, data=memoryview(data))])[1]


def test_what_is_read_back_otherwise_gets_no_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Lossy(Encoder):
        def __call__(self, pixels: Stored) -> bytes:
            return super().__call__(pixels & np.uint8(0xFE))

    log, out = tmp_path / "jump.mcap", tmp_path / "out.mcap"
    write_log(log, JUMP)
    monkeypatch.setattr(compacting, "Encoder", Lossy)
    with pytest.raises(StorageError, match="was read back otherwise than it was written"):
        compact(log, out)
    assert [path.name for path in tmp_path.iterdir()] == ["jump.mcap"]


def test_what_cannot_be_compacted_is_refused(tmp_path: Path) -> None:
    log, out, other = (tmp_path / name for name in ("jump.mcap", "out.mcap", "other.mcap"))
    write_log(log, JUMP)
    compact(log, out)
    with pytest.raises(BadInputError, match="is compacted already"):
        compact(out, other)
    with pytest.raises(BadInputError, match="exists already"):
        compact(log, out)
    data = log.read_bytes()
    log.write_bytes(data[: len(data) // 2])
    with pytest.raises(LogDamagedError, match="was not closed"):
        compact(log, other)
    place = data.index(b'"pulse":2')
    log.write_bytes(data[:place] + b'"pulse":3' + data[place + 9 :])
    with pytest.raises(LogDamagedError, match="its checksum is wrong"):
        compact(log, other)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["jump.mcap", "out.mcap"]


def test_recover_makes_a_plain_log_of_it_again_also_where_it_is_damaged(tmp_path: Path) -> None:
    log, out, plain = (tmp_path / name for name in ("jump.mcap", "out.mcap", "plain.mcap"))
    written = write_log(log, JUMP)
    compact(log, out)
    assert recover(out, plain).lossless
    assert {m for m in messages_of(log) if "triplet" in m[0]} == {m for m in messages_of(plain) if "triplet" in m[0]}
    with LogReader(plain) as reader:
        list(reader.items())
        assert RECOVERY_METADATA in reader.metadata
        assert COMPACT_METADATA not in reader.metadata
    compact(plain, tmp_path / "again.mcap")
    plain.unlink()
    data = bytearray(out.read_bytes())
    data[: data.index(b"svev.compact")] = bytes(data.index(b"svev.compact"))  # header and channels are gone
    with LogReader(out, skim=True) as reader:
        where = next(stored for tag, stored in stored_pulses(reader) if tag.pulse == 2)
    assert where is not None
    data[where.offset + where.length - 9] ^= 4
    out.write_bytes(data)
    assert [pulse for run in recover(out, plain).lost_pixels for pulse in range(run[0], run[1] + 1)] == [2]
    images = {tag.pulse: image.copy() for tag, image in triplets(plain)}
    for pulse in written:
        if pulse.image is not None and pulse.tag.pulse != 2:
            np.testing.assert_array_equal(images[pulse.tag.pulse], pulse.image)


def test_the_command_says_how_much_smaller_and_info_what_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "jump.mcap"
    write_log(log, JUMP)
    assert main(["compact", str(log), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    out = tmp_path / "jump.compact.mcap"
    assert (said["log"], said["pulses"], said["bytes"]) == (str(out), 5, out.stat().st_size)
    assert main(["verify", str(out)]) == 0
    assert main(["info", str(out)]) == 0
    assert "compacted  from jump.mcap" in capsys.readouterr().out
    assert info(out).compacted["codec"] == "ffv1"
    assert main(["compact", str(out)]) == 2
    assert main(["compact", str(log), "-o", str(tmp_path / "archive.mcap")]) == 0
    assert "read back from the disk" in capsys.readouterr().out
    assert FrameStatus.LOST in {status for run in verify(out).ledger.failed.runs for _, status in run.cameras}


def test_compacted_parts_are_parts_of_one_another_under_the_names_they_get(tmp_path: Path) -> None:
    log = tmp_path / "jump.mcap"
    write_log(log, JUMP)
    for part in split_log(log, tmp_path / "r1.mcap", (2, 2)):
        assert main(["compact", str(part)]) == 0
        part.unlink()
    compacted = [tmp_path / f"r1.compact{part}.mcap" for part in ("", "-part2", "-part3")]
    for part in compacted:
        assert parts_of(part) == tuple(compacted)
        assert (info(part).part_before, info(part).part_after) == ("", "")
