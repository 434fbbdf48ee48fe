"""The start list and the next jumper: who follows whom, whatever several operators do, and over a restart."""

import random
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from rig.api.recordings import RecordingOrder
from rig.api.start_list import JumperChange, LineChange, NewLine, Rules, Turn, TurnMark, UndoOrder
from rig.errors import ChangedMeanwhileError, StateForbidsError, UnknownLineError
from rig.events import Event
from service.jumpers.book import JumperBook
from service.jumpers.keeper import NAME, UNDO_NAME, Keeper

LIST = b"bib;athlete;gate;club;class\n1;Anna;12;Lyn;J18\n2;Berit;;Koll;\n3;Cecilie;11;;\n4;Dina;;;\n"


@pytest.fixture
def book() -> JumperBook:
    """Four jumpers; the first is next."""
    book = JumperBook()
    book.import_table(LIST)
    return book


def next_bib(book: JumperBook) -> str:
    return book.view().next.session.bib


def jump(book: JumperBook, recording: str, **fields: str) -> str:
    """Take the next jumper for a recording; returns bib and name."""
    session, _ = book.take(recording, RecordingOrder(**fields))
    return f"{session.bib} {session.athlete}".strip()


def marks(book: JumperBook) -> str:
    """One letter for each line: (w)aiting, (j)umped, (s)kipped."""
    return "".join(line.mark.value[0] for line in book.view().lines)


def test_rounds_go_by_themselves_and_gates_and_wind_are_carried(book: JumperBook) -> None:
    book.change_next(JumperChange(wind="1 m/s", notes="new boots"))
    session, more = book.take("a", RecordingOrder())
    assert (session.bib, session.athlete, session.gate, session.wind) == ("1", "Anna", "12", "1 m/s")
    assert session.notes == "new boots"
    assert more == {"club": "Lyn", "class": "J18", "round": "1"}
    session, more = book.take("b", RecordingOrder(operator="Kari"))
    assert (session.bib, session.gate, session.wind, session.notes) == ("2", "12", "1 m/s", "")
    assert (session.operator, more["round"]) == ("Kari", "1")
    assert [jump(book, "c"), jump(book, "d"), marks(book)] == ["3 Cecilie", "4 Dina", "wwww"]
    assert (book.view().round, jump(book, "e")) == (2, "1 Anna")
    assert book.view().lines[0].jumps == ("a", "e")


def test_skipped_chosen_and_moved_jumpers_come_in_their_turn(book: JumperBook) -> None:
    seen = book.view().next.number
    for _ in range(2):  # two phones skip the same jumper
        book.skip(Turn(number=seen))
    assert (next_bib(book), marks(book)) == ("2", "swww")
    book.choose(4)
    assert jump(book, "a") == "4 Dina"
    assert next_bib(book) == "2", "those who wait come first, from the top"
    book.change_line(3, LineChange(place=1))
    assert [line.bib for line in book.view().lines] == ["3", "1", "2", "4"]
    assert [jump(book, "b"), jump(book, "c")] == ["2 Berit", "3 Cecilie"]
    assert (book.view().round, marks(book), next_bib(book)) == (2, "wwww", "3")


def test_somebody_who_stands_in_no_line_takes_nobodys_turn_or_name(book: JumperBook) -> None:
    book.change_next(JumperChange(bib="2"))  # on the way to 23
    assert book.view().next.session.athlete == "Berit"
    book.change_next(JumperChange(bib="23"))
    assert book.view().next.session.athlete == "", "23 is not Berit"
    book.change_next(JumperChange(athlete="Eva"))
    assert [jump(book, "a"), jump(book, "b"), jump(book, "c")] == ["23 Eva", "1 Anna", "2 Berit"]
    book.change_next(JumperChange(athlete="Cecilia"))  # a correction for this jump
    assert [jump(book, "d"), marks(book)] == ["3 Cecilia", "jjjw"]


def test_the_following_jumper_is_shown_when_the_recording_is(book: JumperBook) -> None:
    jump(book, "a")
    assert (next_bib(book), book.shown.session.bib) == ("2", "1")
    book.announce()
    assert book.shown == book.view().next
    book.change_next(JumperChange(wind="calm"))
    assert book.shown.session.wind == "calm", "edits are shown at once"


def test_a_recording_that_names_its_jumper_leaves_the_list_alone(book: JumperBook) -> None:
    session, more = book.take("a", RecordingOrder(bib="99"))
    assert (session.bib, session.athlete, session.gate, more) == ("99", "", "", {})
    assert (next_bib(book), marks(book)) == ("1", "wwww")


def test_a_mishap_gives_its_jumper_back_unless_the_list_was_changed(book: JumperBook) -> None:
    jump(book, "a")
    book.give_back("a")
    assert (next_bib(book), marks(book), book.view().lines[0].jumps) == ("1", "wwww", ())
    book.give_back("a")  # once only
    jump(book, "b")
    book.change_next(JumperChange(wind="calm"))
    book.give_back("b")
    assert (next_bib(book), marks(book)) == ("2", "wwww"), "somebody has edited the second one"


def test_a_recording_that_gets_another_name_keeps_its_jumper(book: JumperBook) -> None:
    jump(book, "a")
    shown = book.shown
    book.rename("a", "a-2")
    assert (book.view().lines[0].jumps, next_bib(book), book.shown) == (("a-2",), "2", shown)
    book.give_back("a-2")
    assert (next_bib(book), marks(book), book.view().lines[0].jumps) == ("1", "wwww", ())


def test_edits_are_about_the_jumper_that_was_seen(book: JumperBook) -> None:
    seen = book.view().next.number
    jump(book, "a")
    with pytest.raises(ChangedMeanwhileError, match="the next jumper is 2 Berit by now"):
        book.change_next(JumperChange(athlete="Anne", number=seen))
    assert book.view().next.session.athlete == "Berit"


def test_every_change_of_the_list_is_undone_step_by_step(book: JumperBook) -> None:
    views = [book.view()]
    changes: list[Callable[[], object]] = [
        lambda: book.skip(Turn()),
        lambda: book.choose(4),
        lambda: book.add(NewLine(bib="5", athlete="Eva")),
        lambda: book.change_line(5, LineChange(athlete="Eve", place=2)),
        lambda: book.remove(4),
        lambda: book.take("a", RecordingOrder()),
        book.begin_round,
        lambda: book.import_table(b""),
    ]
    for change in changes:
        change()
        views.append(book.view())
    while len(views) > 1:
        left = views.pop()
        found = book.undo(UndoOrder(version=book.view().version))
        with pytest.raises(ChangedMeanwhileError):  # the second half of a double tap
            book.undo(UndoOrder(version=left.version))
        assert (found.lines, found.round, found.next.session) == (
            views[-1].lines,
            views[-1].round,
            views[-1].next.session,
        )
        assert found.version > left.version
    book.undo(UndoOrder())
    with pytest.raises(StateForbidsError, match="nothing to undo"):
        book.undo(UndoOrder())


def test_without_advance_the_jumper_stays_and_without_a_list_names_are_not_carried() -> None:
    book = JumperBook()
    book.change_next(JumperChange(bib="7", athlete="Kari", gate="9"))
    assert jump(book, "a") == "7 Kari"
    assert (next_bib(book), book.view().next.session.gate) == ("", "9")
    assert jump(book, "b") == "", "no name rather than a wrong one"
    book.change_rules(Rules(auto_advance=False, carry=("bib", "athlete")))
    book.change_next(JumperChange(bib="8"))
    assert [jump(book, "c"), jump(book, "d")] == ["8", "8"]
    book.skip(Turn())
    assert (next_bib(book), book.view().next.session.gate) == ("8", "")


def test_lines_that_are_not_there_and_bibs_that_are_taken_are_refused(book: JumperBook) -> None:
    wrong: list[Callable[[], object]] = [
        lambda: book.choose(9),
        lambda: book.remove(9),
        lambda: book.change_line(9, LineChange(bib="1")),
    ]
    for refused in wrong:
        with pytest.raises(UnknownLineError, match="no line 9"):
            refused()
    with pytest.raises(StateForbidsError, match="bib 1 is that of 1 Anna"):
        book.add(NewLine(bib="1"))
    with pytest.raises(StateForbidsError, match="bib 1 is that of 1 Anna"):
        book.change_line(2, LineChange(bib="1"))


def test_the_list_is_there_after_a_restart_and_a_broken_file_is_put_aside(tmp_path: Path) -> None:
    told: list[Event] = []
    book = JumperBook(Keeper(tmp_path, told.append))
    book.import_table(LIST)
    book.change_next(JumperChange(wind="calm"))
    before = jump(book, "a")
    keeper = Keeper(tmp_path, told.append)
    book.skip(Turn())  # waits until it is on the disk
    again = JumperBook(keeper)
    assert before == "1 Anna"
    assert again.view() == book.view()
    said = again.view().undo
    assert said is not None
    assert said.code == "undo_skip"
    assert again.undo(UndoOrder()).next.session.bib == "2"
    assert [again.undo(UndoOrder()).next.session.bib for _ in range(2)] == ["1", ""], "the jump, then the list"
    with pytest.raises(StateForbidsError, match="nothing to undo"):
        again.undo(UndoOrder())
    (tmp_path / UNDO_NAME).write_text('{"version": 0}')  # of another version: the list is there all the same
    assert JumperBook(Keeper(tmp_path, told.append)).view() == again.view()
    (tmp_path / NAME).write_text('{"lines": 1}')
    assert JumperBook(Keeper(tmp_path, told.append)).view().lines == ()
    assert "put aside as .svev-start-list.unreadable" in told[-1].message
    assert (tmp_path / ".svev-start-list.unreadable").exists()


def test_operators_at_once_never_lose_or_double_a_jumper() -> None:
    """Whatever they press meanwhile: each recording has a bib and the name that belongs to it, and is in its line."""
    book = JumperBook()
    book.import_table(b"bib;athlete\n" + b"".join(b"%d;Name %d\n" % (n, n) for n in range(1, 41)))
    said: list[tuple[str, str]] = []

    def operate(seed: int) -> None:
        rng = random.Random(seed)
        for index in range(60):
            view = book.view()
            match rng.choice(["take", "take", "skip", "choose", "edit", "move"]):
                case "take":
                    session, more = book.take(f"{seed}-{index}", RecordingOrder())
                    said.append((more["round"], f"{session.bib};{session.athlete}"))
                case "skip":
                    book.skip(Turn(number=view.next.number))
                case "choose":
                    waiting = [line.id for line in view.lines if line.mark is TurnMark.WAITING]
                    book.choose(rng.choice(waiting or [1]))
                case "edit":
                    book.change_next(JumperChange(wind=str(index)))
                case "move":
                    book.change_line(rng.randint(1, 40), LineChange(place=rng.randint(1, 40)))

    threads = [threading.Thread(target=operate, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert len(said) > 40
    assert all(name.split(";")[1] == f"Name {name.split(';')[0]}" for _, name in said)
    recorded = [recording for line in book.view().lines for recording in line.jumps]
    assert len(recorded) == len(set(recorded)) == len(said)
