"""What a search field understands, and what the catalogue finds by it."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recorder.catalogue.entry import Entry, LogState
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.log_index import FoundJump
from recorder.catalogue.search_words import understood
from recorder.log.beside import measured_path
from recorder.log.session_changes import write_session_changes
from rig.api.athletes import JumpQuery
from rig.api.jump import LastJump, MeasuredValue
from rig.api.recordings import RecordingQuery
from rig.api.statement import Level
from rig.clocks import NS_PER_S
from rig.errors import BadInputError
from tests.recorder.logs import ALL_OK, LOST, OK, PERIOD_NS, write_log
from tests.recorder.split import split_log

TIME = datetime(2026, 11, 21, 10, tzinfo=UTC)


class Judge:
    """Every closed log is good, and has two jumps with the angles that stand in its name, as `a-47-49`."""

    def level(self, entry: Entry) -> Level:
        return Level.GOOD if entry.state is LogState.CLOSED else Level.ERROR

    def jumps(self, log: Path) -> Sequence[FoundJump]:
        return [
            FoundJump(
                LastJump(
                    recording=log.stem, jump=number, time=TIME + timedelta(days=number), ok=True, verdict="well",
                    ski_to_body=MeasuredValue(value=float(angle), sigma=0.5),
                    takeoff_speed=MeasuredValue(value=20.0 + number, sigma=0.1),
                ),
                live=False,
            )
            for number, angle in enumerate(log.stem.split("-")[1:], 1)
        ]  # fmt: skip


@pytest.mark.parametrize("text", ["alpha > 48", "alpha>48", "ALPHA above 48°", "alpha over 48,0 ", "alpha > 48deg"])
def test_a_condition_has_many_spellings(text: str) -> None:
    assert understood(text).figures == [("ski_to_body", ">", 48.0)]


def test_words_conditions_and_quotes_stand_side_by_side() -> None:
    wanted = understood('Berg "New  boots" bib:17 note:"from the left" takeoff <= 25,5 m/s duration >= 3 tag:Fall')
    assert wanted.words == ["berg", "new boots", "m/s"]
    assert wanted.fields == [("bib", "17"), ("notes", "from the left")]
    assert wanted.figures == [("takeoff_speed", "<=", 25.5)]
    assert (wanted.durations, wanted.tags) == ([(">=", 3.0)], ["fall"])


def test_days_months_and_years_are_those_of_this_computer() -> None:
    wanted = understood("date:2026-11 date>=2026-11-21 date<2027")
    days = [datetime(2026, 11, 1), datetime(2026, 11, 21), datetime(2026, 12, 1), datetime(2027, 1, 1)]
    first, third, after, year = (day.astimezone() for day in days)
    assert (wanted.since, wanted.until) == ([first, third], [after, year])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("alpha > x", "write for example alpha > 48"),
        ("alpha >", r"alpha > what\? write for example alpha > 48"),
        ("Berg alpha above ", r"alpha above what\?"),
        ("date >=", "write for example date >= 2026-11-21"),
        ("gamma >", "behind one of alpha, attack"),
        ("gamma > 3", "behind one of alpha, attack"),
        ("alpha:48", "alpha cannot be compared"),
        ("verdict:fine", "verdict:good"),
        ("date:21.11.", "write 2026-11-21"),
    ],
)
def test_what_is_not_understood_says_what_to_write(text: str, said: str) -> None:
    with pytest.raises(BadInputError, match=said):
        understood(text)


@given(st.text(max_size=200))
def test_no_text_fails_otherwise(text: str) -> None:
    with suppress(BadInputError):
        understood(text)


@pytest.fixture
def catalogue(tmp_path: Path) -> Iterator[Catalogue]:
    for name, session in (
        ("a-47-49", {"athlete": "Anna Berg", "bib": "17", "notes": "New boots", "club": "Trondheim"}),
        (
            "b-48",
            {"athlete": "Bjørn Lie", "bib": "4", "note.12": "left ski late", "tags": "fall,wind", "hill": "Granåsen"},
        ),
        ("c", {"athlete": "anna  BERG", "bib": "170"}),
    ):
        write_log(tmp_path / f"{name}.mcap", (ALL_OK,))
        write_session_changes(tmp_path / f"{name}.mcap", session)
    (tmp_path / "broken.mcap").touch()
    with closing(Catalogue(tmp_path, Judge())) as found:
        yield found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "a-47-49 b-48 broken c"),
        ("berg", "a-47-49 c"),
        ("BERG boots", "a-47-49"),
        ('"anna berg"', "a-47-49 c"),
        ("late", "b-48"),
        ("alpha > 48", "a-47-49"),
        ("alpha >= 48", "a-47-49 b-48"),
        ("alpha > 46 alpha < 48", "a-47-49"),
        ("alpha > 48 alpha < 48", ""),  # of one jump: 49 and 47 are two
        ("alpha > 48 takeoff < 21,5", ""),
        ("bib:17", "a-47-49"),
        ("athlete:anna", "a-47-49 c"),
        ("club:trond", "a-47-49"),
        ("hill:gran", "b-48"),
        ("hill:test", "a-47-49 c"),  # the name of the rig
        ("tag:wind", "b-48"),
        ("verdict:error", "broken"),
        ("note:boots", "a-47-49"),
        ("favourite:yes", ""),
        ("100%", ""),
        ("_", ""),
        ("nothing:", "a-47-49 b-48 broken c"),
    ],
)
def test_recordings_are_found(catalogue: Catalogue, text: str, found: str) -> None:
    with_text = catalogue.find(RecordingQuery(search=text))
    assert sorted(entry.id for entry in with_text.entries) == found.split()
    assert with_text.total == len(found.split())
    assert catalogue.find(RecordingQuery(search=text, limit=1)).total == with_text.total


class _Strict:
    """Only recordings without a lost frame are good."""

    def level(self, entry: Entry) -> Level:
        return Level.WARNING if entry.partial else Level.GOOD

    def jumps(self, log: Path) -> Sequence[FoundJump]:
        """Its angle stands beside the log."""
        beside = measured_path(log) / "alpha"
        values = [MeasuredValue(value=float(beside.read_text()), sigma=0.5)] if beside.exists() else []
        return [
            FoundJump(
                LastJump(recording=log.stem, jump=1, time=TIME, ok=True, verdict="well", ski_to_body=value), False
            )
            for value in values
        ]


def test_a_split_recording_is_found_by_its_whole(tmp_path: Path) -> None:
    """By how long it is and how good, whichever part makes it so, and by its jumps, which lie beside the first part."""
    write_log(tmp_path / "whole.mcap", (*(ALL_OK,) * 8, (OK, LOST, OK), ALL_OK))
    folder = tmp_path / "folder"
    folder.mkdir()
    parts = split_log(tmp_path / "whole.mcap", folder / "r1.mcap", (4, 3))
    measured_path(parts[0]).mkdir()
    (measured_path(parts[0]) / "alpha").write_text("49")
    longest = 8.5 * PERIOD_NS / NS_PER_S
    with closing(Catalogue(folder, _Strict())) as catalogue:

        def found(text: str) -> list[str]:
            return [entry.id for entry in catalogue.find(RecordingQuery(search=text)).entries]

        for text in (f"duration > {longest}", "verdict:warning", "alpha > 48", ""):
            assert found(text) == ["r1"], text
        assert (found(f"duration < {longest}"), found("verdict:good")) == ([], [])
        renamed = [part.rename(part.with_name(part.name.replace("r1", "training"))) for part in parts]
        assert found(f"duration > {longest}") == found("") == ["training"]
        last = renamed[2].rename(tmp_path / renamed[2].name)
        assert found("verdict:warning") == ["training"], "a part is missing"
        assert found(f"duration > {longest}") == found("verdict:good") == []
        last.rename(renamed[2])
        assert found("verdict:warning") == ["training"]
        renamed[1].rename(tmp_path / renamed[1].name)
        assert sorted(found("")) == sorted(found("verdict:warning")) == ["training", "training-part3"]
        shutil.copy(renamed[2], folder / "copy.mcap")
        assert sorted(found("")) == ["copy", "training", "training-part3"], "a copy of a part is listed"


def test_jumps_are_found_one_by_one(catalogue: Catalogue) -> None:
    def found(**query: str) -> list[tuple[str, int]]:
        return [(name, jump) for name, jump in catalogue.jumps(JumpQuery(**query), "r.id, j.jump")]

    assert found() == [("a-47-49", 2), ("b-48", 1), ("a-47-49", 1)]
    assert found(search="alpha > 47 berg") == [("a-47-49", 2)]
    assert found(athlete="anna berg") == [("a-47-49", 2), ("a-47-49", 1)]
    catalogue.change_session("a-47-49", {"athlete": "Kari Moe"})
    assert found(athlete="kari moe", search="alpha<48") == [("a-47-49", 1)]
    catalogue.delete("a-47-49")
    assert found() == [("b-48", 1)]
