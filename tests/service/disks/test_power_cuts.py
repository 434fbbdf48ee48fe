"""The power goes at any moment: what a disk may hold then is read by the real program, 500 times.

All calls of a service that change its folder are recorded (`tests.support.recorded_disk`); each cut is what a disk may
hold of them at a moment, with what was not made durable lost in part. Everything that was there a second before has to
be there, as it was then or as it was later.
"""

import json
import random
import shutil
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import pytest

from recorder.catalogue.database import NAME as CATALOGUE
from recorder.catalogue.entry import SUFFIX
from recorder.catalogue.folder import Catalogue
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import stored_triplets
from rig.clocks import NS_PER_S
from rig.errors import BadInputError
from tests.analysis.measured import FIRST_DAY, PULSES
from tests.analysis.simulated import training
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.kept import kept_hill_log
from tests.support.loopback import Loopback
from tests.support.recorded_disk import History, RecordedDisk, lay_out
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

_CUTS: Final = 500
#: After every fifth one the recordings are listed, by the catalogue and anew.
_LISTED: Final = 5
_MARKS: Final = ".jsonl"
_MEASURED_S: Final = 300.0
_OLD_NS: Final = NS_PER_S
#: Longer than that: whoever did something, and nothing since, finds it after a cut.
_PAUSE_S: Final = 1.5
#: What need not be there: locks, and what simulated cameras alone tell.
_OF_THE_MOMENT: Final = (".svev.lock", ".truth.json", ".survey.json")


def _rig(folder: Path, loopback: Loopback) -> Path:
    """A rig with small frames, so that logs are small, whose recordings are split."""
    rig = write_rig(folder, "sim", loopback)
    text = rig.read_text().replace("[network]", "[recorder]\nreserve_gb = 0\npart_s = 2\n[network]")
    region = "region = { x = 256, y = 192, width = 128, height = 96 }"
    rig.write_text(text.replace('backend = "sim"', f'backend = "sim"\n{region}'))
    return rig


def _work(service: Serving) -> None:
    """What people do on a day."""
    service.call_table(b"bib;athlete;gate\n17;Ola;9\n18;Kari;9\n19;Per;9\n")
    time.sleep(_PAUSE_S)
    service.arm()
    for place in range(3):
        recording = service.post("/api/recordings", {"preroll_s": 1 if place else 0})["id"]
        service.await_pulses(20)
        service.call("PATCH", f"/api/recordings/{recording}", {"gate": "10", "notes": "wind"})
        service.call("PATCH", "/api/next-jumper", {"notes": f"round {place}"})
        service.await_pulses(75)
        service.post(f"/api/recordings/{recording}/stop")
        assert service.get("/api/recordings")
        service.call("PATCH", f"/api/recordings/{recording}", {"notes": "fell", "tags": "wind"})
        time.sleep(_PAUSE_S)
    service.call("DELETE", f"/api/recordings/{recording}")
    _, undone = service.call("POST", "/api/start-list/undo")
    assert undone["lines"]
    time.sleep(_PAUSE_S)
    service.call("POST", f"/api/recordings/{recording}/restore")


class _Logs:
    """The pulses in the logs as they were in the end: their images, and when each was in its file."""

    def __init__(self, history: History, folder: Path) -> None:
        self.images: dict[tuple[str, int], bytes] = {}
        self.written_ns: dict[tuple[str, int], int] = {}
        for log in folder.glob(f"*{SUFFIX}"):
            with LogReader(log) as reader:
                for stored in stored_triplets(reader):
                    key = log.name, int(stored.tag.pulse)
                    self.images[key] = stored.image(reader).tobytes()
                    self.written_ns[key] = history.written_ns(log.name, stored.offset, stored.offset + stored.length)

    def missing(self, left: Path, until_ns: int) -> Iterator[str]:
        """The pulses that were written until a time and are not there, bit for bit."""
        found: dict[tuple[str, int], bytes] = {}
        for log in left.rglob(f"*{SUFFIX}"):
            with suppress(BadInputError), LogReader(log) as reader:  # one that was just being made
                for stored in stored_triplets(reader):
                    try:
                        found[log.name, int(stored.tag.pulse)] = stored.image(reader).tobytes()
                    except ValueError:
                        continue  # the last one, in part
        for key, image in self.images.items():
            if self.written_ns[key] <= until_ns and found.get(key) != image:
                yield f"{key[0]}: pulse {key[1]} is not there"


def _is_whole(name: str) -> bool:
    """Whether a file is always written as a whole."""
    last = name.rpartition("/")[2]
    hidden = last.startswith(".") and not last.startswith(".svev")
    return not (hidden or last.startswith(CATALOGUE) or last.endswith((SUFFIX, *_OF_THE_MOMENT)))


def test_everything_older_than_a_second_is_there_after_a_power_cut(tmp_path: Path, loopback: Loopback) -> None:
    root, notes = tmp_path / "data", tmp_path / "notes"
    root.mkdir()
    notes.mkdir()
    disk = RecordedDisk(notes, root)
    prefix = ("env", *(f"{name}={value}" for name, value in disk.environment.items()))
    with serving(tmp_path, _rig(tmp_path, loopback), loopback, prefix=prefix, data=root) as service:
        _work(service)
    history = disk.history()
    there = {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}
    assert history.seen(history.calls[-1].end) == there, "all that was done is recorded"
    logs = _Logs(history, root)
    assert len(logs.images) > 200
    draw = random.Random(7)
    begin, last = history.calls[0].time_ns, history.calls[-1].time_ns
    moments = [draw.randrange(begin, last + _OLD_NS) for _ in range(_CUTS // 2)]
    moments += [draw.choice(history.calls).time_ns for _ in range(_CUTS // 2)]
    found: dict[str, list[str]] = {}
    left = tmp_path / "left"
    for number, moment in enumerate(moments):
        lay_out(history.after_cut(history.at(moment), draw), left)
        wrong = [*_missing(history, logs, left, moment), *(() if number % _LISTED else _wrongly_listed(left))]
        if wrong:
            found[f"cut {(moment - begin) / NS_PER_S:.3f} s after the beginning"] = wrong
        shutil.rmtree(left)
    assert not found, f"{len(found)} of {_CUTS} cuts: {json.dumps(found, indent=1)[:5000]}"


def _missing(history: History, logs: _Logs, left: Path, moment_ns: int) -> Iterator[str]:
    """What was there a second before a cut, and is not after it."""
    before_ns, end = moment_ns - _OLD_NS, history.at(moment_ns)
    yield from logs.missing(left, before_ns)
    for name, versions in history.versions(history.at(before_ns), end, _is_whole).items():
        path = left / name
        content = path.read_bytes() if path.exists() else None
        if content not in versions:
            lost = "is not there" if content is None else f"is {content[:80]!r}"
            yield f"{name} {lost}, none of {len(versions)} versions"


def _wrongly_listed(left: Path) -> Iterator[str]:
    """Whether the catalogue's file, as the cut has left it, says something else than the logs."""
    catalogue = Catalogue(left)
    try:
        listed = catalogue.entries()
    finally:
        catalogue.close()
    (left / CATALOGUE).unlink(missing_ok=True)
    again = Catalogue(left)
    try:
        if listed != again.entries():
            yield "the catalogue is not what the logs say"
    finally:
        again.close()


def _is_kept(name: str) -> bool:
    """Whether a file is the rig file or a result, and neither one in the making nor marks, which are told by lines."""
    return not any(part.startswith(".") for part in Path(name).parts) and not name.endswith(_MARKS)


def _act_on_a_jump(service: Serving, recording: str) -> None:
    """Keep settings in the rig file, mark by hand, have the jump measured, correct its name, mark again."""
    for seconds in (600, 900, 1200):
        service.call("PATCH", "/api/parts", {"part_s": seconds, "save": True})
        time.sleep(_PAUSE_S / 3)
    _mark(service, recording, 10)
    assert service.call("POST", f"/api/recordings/{recording}/measurement")[0] == 202
    _await_measured(service, recording)
    time.sleep(_PAUSE_S)
    service.call("PATCH", f"/api/recordings/{recording}", {"athlete": "Kari Nordmann"})
    service.call("PATCH", "/api/parts", {"part_s": None, "part_gb": 4, "save": True})
    _mark(service, recording, 30)
    time.sleep(_PAUSE_S)


def _mark(service: Serving, recording: str, first: int) -> None:
    base = f"/api/recordings/{recording}/digitizing"
    assert service.get(base)["cameras"]
    for number in range(12):
        action = {"do": "place", "pulse": first + number, "camera": "K1", "thing": "P1", "xy": [200.5, 100.0 + number]}
        status, answer = service.call("POST", f"{base}/sessions/Anna/actions", action)
        assert status == 200, answer
        time.sleep(_PAUSE_S / 12)
    assert service.call("POST", f"{base}/sessions/Anna/actions", {"do": "undo"})[0] == 200


def _await_measured(service: Serving, recording: str) -> None:
    def is_done() -> bool:
        return bool(service.get(f"/api/recordings/{recording}/measurement")["state"] == "done")

    wait_until(is_done, "it is measured", _MEASURED_S)


@pytest.mark.alone
@pytest.mark.timeout(900)
def test_rig_file_marks_and_results_outlive_a_power_cut(tmp_path: Path, loopback: Loopback) -> None:
    root, notes = tmp_path / "disk", tmp_path / "notes"
    (root / "data").mkdir(parents=True)
    notes.mkdir()
    jump = kept_hill_log(training(), PULSES, FIRST_DAY)
    recording = jump.path.stem
    shutil.copy(jump.path, root / "data")
    rig = _rig(root, loopback)
    rig.write_text(f'{rig.read_text()}[analysis]\nsurvey = "{jump.survey}"\n')
    disk = RecordedDisk(notes, root)
    prefix = ("env", *(f"{name}={value}" for name, value in disk.environment.items()))
    with serving(tmp_path, rig, loopback, prefix=prefix, data=root / "data") as service:
        _act_on_a_jump(service, recording)
    history = disk.history()
    last = {name: content for name, content in history.seen(history.calls[-1].end).items() if _is_kept(name)}
    assert last == {name: (root / name).read_bytes() for name in last}, "all that was done is recorded"
    marks = f"data/{recording}.digitized/Anna{_MARKS}"
    assert {rig.name, f"data/{recording}.measured/jumper.json"} <= {*last}
    draw, found = random.Random(13), dict[str, list[str]]()
    begin, end_ns = history.calls[0].time_ns, history.calls[-1].time_ns
    for cut in range(_CUTS):
        moment = draw.choice(history.calls).time_ns if cut % 2 else draw.randrange(begin, end_ns + _OLD_NS)
        before, end = history.at(moment - _OLD_NS), history.at(moment)
        left = history.after_cut(end, draw)
        lost = [name for name, all_ in history.versions(before, end, _is_kept).items() if left.get(name) not in all_]
        if not left.get(marks, b"").startswith(history.seen(before).get(marks, b"")):
            lost.append(marks)
        if lost:
            found[f"cut {(moment - begin) / NS_PER_S:.3f} s after the beginning"] = lost
    assert not found, f"{len(found)} of {_CUTS} cuts: {json.dumps(found, indent=1)[:5000]}"
