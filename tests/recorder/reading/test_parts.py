"""A recording that is split into several logs is read as one, whichever of them is named, and tells what is missing."""

from pathlib import Path

import numpy as np
import pytest

from recorder.checking.verify import Verdict, verify
from recorder.publishing.replay import ReplayOptions, replay
from recorder.reading.info import info
from recorder.reading.parts import RecordingReader, parts_of
from recorder.reading.triplets import stored_triplets, tags, triplets
from tests.recorder.logs import ALL_OK, LOST, OK, write_log
from tests.recorder.split import split_log
from tests.support.loopback import Loopback

PULSES = (ALL_OK,) * 4 + ((OK, LOST, OK),) + (ALL_OK,) * 5
Split = tuple[Path, list[Path]]


@pytest.fixture
def split(tmp_path: Path) -> Split:
    """A log, and its parts in another folder."""
    log, folder = tmp_path / "jump.mcap", tmp_path / "parts"
    folder.mkdir()
    write_log(log, PULSES)
    return log, split_log(log, folder / "r1.mcap", (4, 3))


def test_any_part_stands_for_the_whole_recording(split: Split) -> None:
    log, parts = split
    whole = [(tag, image.copy()) for tag, image in triplets(log)]
    for part in parts:
        assert parts_of(part) == tuple(parts)
        read = [(tag, image.copy()) for tag, image in triplets(part)]
        assert [tag for tag, _ in read] == [tag for tag, _ in whole] == list(tags(part))
        assert all(np.array_equal(one, other) for (_, one), (_, other) in zip(read, whole, strict=True))
        about = info(part, whole=True)
        assert (about.ledger.counts(), about.closed) == (info(log).ledger.counts(), True)
        assert (about.ledger.duration_s, about.ledger.pauses()) == (info(log).ledger.duration_s, ())


def test_single_images_are_found_in_their_part(split: Split) -> None:
    log, parts = split
    whole = {tag.pulse: image.copy() for tag, image in triplets(log)}
    with RecordingReader(parts[1], skim=True) as reader:
        stored = stored_triplets(reader)
        assert reader.size == sum(part.stat().st_size for part in parts)
        for triplet in (*stored, *reversed(stored)):
            assert np.array_equal(triplet.image(reader), whole[triplet.tag.pulse])


def test_each_part_is_whole_and_clean_beside_the_others(split: Split) -> None:
    _, parts = split
    reports = [verify(part) for part in parts]
    assert [report.verdict for report in reports] == [Verdict.CLEAN, Verdict.PARTIAL, Verdict.CLEAN]
    assert [report.ledger.pulses for report in reports] == [4, 3, 3]
    assert [(info(part).part, info(part).part_before, info(part).part_after) for part in parts] == [
        (1, "", ""), (2, "", ""), (3, "", ""),
    ]  # fmt: skip


def test_a_missing_part_is_told_from_both_sides(split: Split) -> None:
    _, (first, second, third) = split
    second.unlink()
    assert list(verify(first).parts_in_words()) == [
        "goes on in r1-part2, which does not lie beside it: its pulses are not in this log"
    ]
    assert list(verify(third).parts_in_words()) == [
        "goes on from r1-part2, which does not lie beside it: its pulses are not in this log"
    ]
    assert verify(first).verdict is verify(third).verdict is Verdict.PARTIAL
    assert (parts_of(first), parts_of(third)) == ((first,), (third,))
    third.unlink()
    assert info(first, whole=True).part_after == "r1-part2"


def test_parts_are_known_by_what_they_say(split: Split) -> None:
    log, parts = split
    renamed = [part.rename(part.with_name(part.name.replace("r1", "training"))) for part in parts]
    for part in renamed:
        assert list(tags(part)) == list(tags(log))
        assert (info(part).part_before, info(part).part_after) == ("", "")
        assert list(verify(part).parts_in_words()) == []
    renamed[1].unlink()
    assert info(renamed[0]).part_after == info(renamed[2]).part_before == "r1-part2"


def test_another_recording_of_the_name_of_a_part_is_passed_over(tmp_path: Path, split: Split) -> None:
    log, folder = split[0], tmp_path / "taken"
    folder.mkdir()
    write_log(folder / "r1-part2.mcap")
    for part in split_log(log, folder / "r1.mcap", (4, 3), second=3):
        assert list(tags(part)) == list(tags(log))
    assert parts_of(folder / "r1-part2.mcap") == (folder / "r1-part2.mcap",)


def test_a_part_that_was_not_closed_is_read_as_far_as_it_goes(split: Split) -> None:
    log, parts = split
    data = parts[2].read_bytes()
    parts[2].write_bytes(data[: data.index(b"\x0f\x04\0\0\0\0\0\0\0")])
    about = info(parts[0], whole=True)
    assert (about.closed, about.ledger.counts()) == (False, info(log).ledger.counts())
    left = info(parts[2])
    assert (left.missing_pulses, left.ledger.pauses()) == (0, ())


def test_a_replay_sends_all_parts(split: Split, loopback: Loopback) -> None:
    log, parts = split
    options = ReplayOptions(loopback.endpoint(), speed=None, wait_s=0.0)
    sent = replay(parts[1], options)
    whole = replay(log, options)
    assert (sent.triplets, sent.bytes, sent.closed) == (whole.triplets, whole.bytes, True)
