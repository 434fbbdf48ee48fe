"""Logs with an image of each camera on a topic of its own: to readers of ours they are logs like all others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from recorder.catalogue.entry import LogState
from recorder.catalogue.folder import Catalogue
from recorder.checking.verify import verify
from recorder.log.mcap_layout import camera_image_prefix
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.info import info
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import stored_triplets, triplets
from recorder.recovering.recover import recover
from rig.clocks import UtcNs
from rig.frame import FrameStatus
from tests.recorder.logs import (
    ABSENT,
    ALL_OK,
    DESCRIPTION,
    LOST,
    OK,
    OWN_TOPICS,
    SHAPE,
    make_image,
    make_tag,
    write_log,
)

JUMP = (ALL_OK, (OK, LOST, OK), (ABSENT,) * 3, ALL_OK, ALL_OK)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "logs" / "jump.mcap"
    path.parent.mkdir()
    write_log(path, JUMP, cameras=OWN_TOPICS)
    return path


def test_any_reader_finds_each_cameras_images(tmp_path: Path) -> None:
    log = tmp_path / "jump.mcap"
    calibrations = {name: CameraCalibration(frame_id=name).SerializeToString() for name, _ in OWN_TOPICS}
    written = write_log(log, JUMP, cameras=OWN_TOPICS, description=replace(DESCRIPTION, calibrations=calibrations))
    with log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found: dict[tuple[str, int], np.ndarray] = {}
        for schema, channel, message, image in reader.iter_decoded_messages(
            topics=[f"/camera/{n}" for n, _ in OWN_TOPICS]
        ):
            assert schema is not None
            assert (schema.name, channel.message_encoding) == ("foxglove.RawImage", "protobuf")
            assert (image.encoding, image.width, image.height, image.step) == ("mono8", 30, SHAPE[0], 30)
            assert image.frame_id == channel.topic.removeprefix("/camera/")
            assert image.timestamp.ToNanoseconds() == message.publish_time
            found[channel.topic, message.sequence] = np.frombuffer(image.data, np.uint8).reshape(SHAPE[0], 30)
        summary = reader.get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    assert topics >= {"/camera/K1", "/calibration/K1", "/triplet/tag"}
    assert "/triplet" not in topics
    images = {pulse.tag.pulse: pulse.image for pulse in written if pulse.image is not None}
    assert set(found) == {(f"/camera/{name}", pulse) for name, _ in OWN_TOPICS for pulse in images}
    for name, (first, end) in OWN_TOPICS:
        for pulse, image in images.items():
            assert np.array_equal(found[f"/camera/{name}", pulse], image[:, first:end])


def test_tags_and_triplets_are_those_of_any_log(log: Path, tmp_path: Path) -> None:
    written = write_log(tmp_path / "usual.mcap", JUMP)
    for (tag, image), (usual_tag, usual), pulse in zip(
        triplets(log), triplets(tmp_path / "usual.mcap"), written, strict=True
    ):
        assert tag == usual_tag == pulse.tag
        assert np.array_equal(image, usual)
    assert info(log).to_json()["pulses"] == 5
    assert verify(log).verdict == verify(tmp_path / "usual.mcap").verdict == "partial"
    assert verify(log).findings == ()


def test_single_images_are_found_without_reading_others(log: Path) -> None:
    catalogue = Catalogue(log.parent)
    assert catalogue.entry("jump").state is LogState.CLOSED
    for pulse in (1, 2, 5):
        tag = make_tag(pulse, JUMP[pulse - 1])
        assert np.array_equal(catalogue.image("jump", pulse), make_image(tag))
    with LogReader(log, skim=True) as reader:
        assert [stored.tag.pulse for stored in stored_triplets(reader)] == [1, 2, 4, 5]


@pytest.mark.parametrize("beheaded", [False, True])
@pytest.mark.parametrize("keep", [1.0, 0.7])
def test_recover_saves_all_that_is_there(log: Path, tmp_path: Path, keep: float, beheaded: bool) -> None:
    data = log.read_bytes()
    broken = tmp_path / "broken.mcap"
    broken.write_bytes((bytes(4096) if beheaded else data[:4096]) + data[4096 : int(len(data) * keep)])
    report = recover(broken, tmp_path / "whole.mcap")
    assert report.ledger.pulses >= 3
    assert report.lost_pixels == ()
    assert not verify(tmp_path / "whole.mcap").damaged
    for tag, image in triplets(tmp_path / "whole.mcap"):
        statuses = JUMP[tag.pulse - 1]
        expected = np.zeros(SHAPE, np.uint8) if statuses == (ABSENT,) * 3 else make_image(make_tag(tag.pulse, statuses))
        assert np.array_equal(image, expected)
    topics = set(info(tmp_path / "whole.mcap").messages)
    assert ("/camera/K2" in topics, "/triplet" in topics) == (not beheaded, beheaded), (
        "names of cameras were in the head"
    )


def test_verify_notices_images_that_are_not_those_of_the_tags(log: Path) -> None:
    data = log.read_bytes()
    for old, new in ((b"/camera/K2", b"/camera/K9"), (b"mono8", b"mono9")):
        assert old in data
        other = log.with_name("other.mcap")
        other.write_bytes(data.replace(old, new))
        assert verify(other).damaged


def test_cameras_of_other_widths_than_the_tags_say_are_noticed(tmp_path: Path) -> None:
    uneven = (("K1", (0, 20)), ("K2", (20, 60)), ("K3", (60, 90)))
    write_log(tmp_path / "uneven.mcap", (ALL_OK,), cameras=uneven)
    assert verify(tmp_path / "uneven.mcap").findings == ("pulse 1: its images are not those of the cameras in its tag",)


@pytest.mark.parametrize("time", [0, 1, 999_999_999, 1_000_000_000, 1_795_216_434_000_000_000, (1 << 64) - 1])
def test_what_stands_before_the_pixels_is_always_as_long(time: int) -> None:
    heads = {len(camera_image_prefix((480, 640), UtcNs(t), "K1")) for t in (time, 1_795_216_434_399_239_000)}
    assert len(heads) == 1


def test_a_single_camera_has_its_topic_too(tmp_path: Path) -> None:
    log = tmp_path / "one.mcap"
    write_log(log, ((OK,), (OK,), (FrameStatus.MISSED,)), shape=(24, 30), cameras=OWN_TOPICS[:1])
    assert verify(log).findings == ()
    assert [tag.complete for tag, _ in triplets(log)] == [True, True, False]


def test_blocks_of_a_slot() -> None:
    for cameras in ((), OWN_TOPICS):
        buffers = TripletBuffers(SHAPE, 1, cameras)
        image = make_image(make_tag(1))
        for _, (first, end) in OWN_TOPICS:
            buffers.block(0, (first, end))[:] = image[:, first:end]
        assert np.array_equal(buffers.pixels(0), image)
        buffers.write(0, 0)
        assert not buffers.pixels(0).any()
        with pytest.raises(ValueError, match="not those of a camera"):
            buffers.block(0, (60, 99))
        buffers.close()
