"""Damaged logs by the hundred: no wrong "clean", no error but ours, and every pulse that is whole is recovered."""

import os
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from recorder.checking.verify import Verdict, verify
from recorder.reading.info import info
from recorder.reading.triplets import triplets
from recorder.recovering.recover import RecoverReport, recover
from rig.errors import BadInputError
from rig.tag import TripletTag
from tests.recorder.damage import Original, corrupted, cut, make_original, with_copied_block
from tests.support.reliability import FaultTable

_Read = dict[int, tuple[TripletTag, NDArray[np.uint8]]]

#: 10 for all: 500 cuts, 300 corruptions, 200 copied blocks.
SCALE = int(os.environ.get("SVEV_DAMAGE", "2"))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Original:
    return make_original(tmp_path_factory.mktemp("original"))


@pytest.mark.parametrize(
    ("damage", "seeds"),
    [(cut, range(50 * SCALE)), (corrupted, range(30 * SCALE)), (with_copied_block, range(20 * SCALE))],
    ids=["cuts", "corruptions", "copied blocks"],
)
def test_every_whole_pulse_is_recovered(
    original: Original,
    tmp_path: Path,
    fault_table: FaultTable,
    damage: Callable[[bytes, random.Random], bytes],
    seeds: range,
) -> None:
    problems, counts = list[str](), Counter[str]()
    for seed in seeds:
        data = damage(original.data, random.Random(seed))
        path, new = tmp_path / "log.mcap", tmp_path / "new.mcap"
        path.write_bytes(data)
        intact = original.intact_in(data)
        problems += [f"seed {seed}: {text}" for text in _wrong(original, path, new, intact, counts)]
        new.unlink(missing_ok=True)
    assert not problems, (len(problems), counts, problems[:20])
    names = {"cut": "cut off anywhere", "corrupted": "changed, zeroed, shortened or lengthened anywhere"}
    what = f"a log is {names.get(damage.__name__, 'overwritten in places by blocks of itself')}, {len(seeds)} times"
    lost = f"0 of {counts['intact']} whole ones, with `svev recover`"
    fault_table.tell("Logs", what, lost=lost, said="never clean; no error but ours", code="2 or 3")


def _wrong(original: Original, path: Path, new: Path, intact: set[int], counts: Counter[str]) -> list[str]:
    """What is not as it should be."""
    wrong = []
    counts["intact"] += len(intact)
    same = path.read_bytes() == original.data
    try:
        verdict = verify(path).verdict
        info(path)
        if verdict is not Verdict.DAMAGED and not same:
            wrong.append(f"verify says {verdict.value}")
    except BadInputError:
        counts["refused"] += 1
    try:
        report = recover(path, new)
    except BadInputError as error:
        return [*wrong, f"{error}, but {len(intact)} pulses are whole"] if intact else wrong
    found = verify(new)
    wrong += [f"recovered: {finding}" for finding in found.findings]
    if found.damaged:
        wrong.append("what was recovered is damaged")
    if not report.lossless and "is lost: " not in found.events[-1].message:
        wrong.append(f"the new log says that nothing was lost, the report: {report.in_words()}")
    read: _Read = {tag.pulse: (tag, image.copy()) for tag, image in triplets(new)}
    for pulse in sorted(intact):
        if pulse not in read or not _same(original, *read[pulse]):
            counts["intact, lost"] += 1
            wrong.append(f"pulse {pulse} is whole, and lost")
    wrong += _invented(original, report, read)
    return wrong


def _invented(original: Original, report: RecoverReport, read: _Read) -> list[str]:
    """Recovered pulses that are neither what was written nor called damaged."""
    lost = {pulse for first, last in report.lost_pixels for pulse in range(first, last + 1)}
    return [
        f"pulse {pulse} is not what was written"
        for pulse, (tag, image) in read.items()
        if pulse not in original.written
        or (not _same(original, tag, image) and (pulse not in lost or image.any() or tag.complete))
    ]


def _same(original: Original, tag: TripletTag, image: NDArray[np.uint8]) -> bool:
    written = original.written[tag.pulse]
    expected = np.zeros(tag.shape, np.uint8) if written.image is None else written.image
    return tag == written.tag and np.array_equal(image, expected)
