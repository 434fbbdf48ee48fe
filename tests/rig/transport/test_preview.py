"""The preview slot between real processes: a reader never sees parts of two images, whichever process dies."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.pulse import RigPulse
from rig.transport.preview import MAX_PER_S, PreviewSlot
from tests.rig.transport.hammering_process import KINDS

REPOSITORY = Path(__file__).parents[3]
OK, LOST = FrameStatus.OK, FrameStatus.LOST
SHAPE = (480, 1920)
IMAGES = 40


@pytest.fixture
def slot() -> Iterator[PreviewSlot]:
    slot = PreviewSlot.create(SHAPE, 3)
    yield slot
    slot.close()


@contextmanager
def _writer(slot: PreviewSlot) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-m", "tests.rig.transport.hammering_process", str(slot.fd)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=REPOSITORY, pass_fds=(slot.fd,)
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "first\n"
        yield process
        process.kill()


def test_a_reader_never_sees_two_images_in_one(slot: PreviewSlot) -> None:
    with _writer(slot) as process:
        seen: set[int] = set()
        deadline = time.monotonic() + 60
        while len(seen) < IMAGES and time.monotonic() < deadline:
            image = slot.read()
            if image is None:  # no whole one within the reader's patience
                continue
            assert set(np.unique(image.pixels)) == {image.pulse % 251}
            assert int(image.time) == image.pulse
            assert image.statuses == (KINDS[image.pulse % len(KINDS)],) * 3
            seen.add(image.pulse)
        written = process.communicate(input="", timeout=30)[0]
    assert len(seen) == IMAGES
    assert int(written) >= max(seen)


def test_without_the_check_the_test_above_would_find_mixed_images(slot: PreviewSlot) -> None:
    with _writer(slot):
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and len(np.unique(slot._copy().pixels)) < 2:
            pass
    assert time.monotonic() < deadline


def test_a_writer_that_dies_while_writing_blocks_nobody(slot: PreviewSlot) -> None:
    slot._words[16] = 7  # as if killed in the middle
    assert slot.read() is None
    with _writer(slot) as process:
        process.send_signal(signal.SIGKILL)
        process.wait()
    new = PreviewSlot(os.dup(slot.fd))
    new.take_over(SHAPE)
    assert slot.read() is None
    assert slot.newest() == 0
    new.write(RigPulse(1), HostNs(5), (OK, LOST, OK), np.full(SHAPE, 9, np.uint8), host_now())
    new.close()
    image = slot.read()
    assert image is not None
    assert (image.pulse, image.time, image.statuses, image.pixels.max()) == (1, 5, (OK, LOST, OK), 9)


def test_images_are_wanted_for_a_while_and_not_too_often(slot: PreviewSlot) -> None:
    assert slot.read() is None
    assert not slot.due(host_now())
    slot.want(60)
    now = host_now()
    assert slot.due(now)
    assert not slot.due(HostNs(now + 61 * NS_PER_S))
    slot.write(RigPulse(1), now, (OK,) * 3, np.ones(SHAPE, np.uint8), now)
    assert not slot.due(HostNs(now + NS_PER_S // MAX_PER_S - 1))
    assert slot.due(HostNs(now + NS_PER_S // MAX_PER_S))
    slot.write(RigPulse(2), now, (LOST,) * 3, None, now)
    image = slot.read()
    assert image is not None
    assert (image.pulse, image.statuses, image.pixels.any()) == (2, (LOST,) * 3, np.False_)
    slot.want(0)
    assert not slot.due(HostNs(now + NS_PER_S))


def test_an_image_read_is_a_copy_of_its_own(slot: PreviewSlot) -> None:
    slot.write(RigPulse(1), HostNs(0), (OK,) * 3, np.full(SHAPE, 3, np.uint8), HostNs(0))
    image = slot.read()
    slot.write(RigPulse(2), HostNs(0), (OK,) * 3, np.full(SHAPE, 4, np.uint8), HostNs(0))
    assert image is not None
    assert set(np.unique(image.pixels)) == {3}


def test_another_descriptor_is_refused() -> None:
    fd = os.memfd_create("other")
    os.ftruncate(fd, 8192)
    with pytest.raises(BadInputError, match="is no preview slot"):
        PreviewSlot(fd)
    os.close(fd)


def test_triplets_of_another_size_come_from_another_recorder(slot: PreviewSlot) -> None:
    with closing(PreviewSlot(os.dup(slot.fd))) as writer:
        for shape in ((483, 4000), (479, 1921)):
            writer.take_over(shape)
            assert slot.read() is None
            writer.write(RigPulse(1), host_now(), (OK,) * 3, np.full(shape, 7, np.uint8), host_now())
            image = slot.read()
            assert image is not None
            assert slot.shape == image.pixels.shape == shape
            assert (image.pixels == 7).all()
