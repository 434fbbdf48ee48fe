"""A jump of which there may be no recording is said."""

from rig.api.start_list import StartLine, StartList, TurnMark
from rig.api.statement import Level
from rig.phrase import plain
from service.alarms.unrecorded import Unrecorded

LINES = tuple(StartLine(id=bib, bib=str(bib), athlete=f"Jumper {bib}") for bib in (1, 2))
LIST = StartList(lines=LINES)


def _skipped(line: int) -> StartList:
    lines = [each.model_copy(update={"mark": TurnMark.SKIPPED}) if each.id == line else each for each in LINES]
    return LIST.model_copy(update={"lines": tuple(lines)})


def test_somebody_who_was_seen_is_said_unless_a_recording_begins_soon() -> None:
    watch = Unrecorded()
    watch.moved(10.0)
    assert watch.look(LIST, waits=True, now=11.0) is None, "a recording may begin that reaches back"
    assert watch.look(LIST, waits=False, now=12.0) is None
    assert watch.look(LIST, waits=True, now=20.0) is None, "it did"
    watch.moved(30.0)
    said = watch.look(LIST, waits=True, now=34.0)
    assert said is not None
    assert "the last jump may not be recorded" in said.text
    assert watch.look(LIST, waits=True, now=99.0) == said
    assert watch.look(LIST, waits=False, now=100.0) is None
    assert watch.look(LIST, waits=True, now=101.0) is None


def test_a_jump_for_which_no_recording_could_begin_is_said_until_one_does() -> None:
    watch = Unrecorded()
    watch.refused(plain("the disk is full"))
    for waits in (True, False):  # whatever the rig does meanwhile
        said = watch.look(LIST, waits=waits, now=1.0)
        assert said is not None
        assert (said.level, said.code) == (Level.ERROR, "alarm_unrecorded_refused")
        assert said.text == "a jump came, and no recording could begin: the disk is full"
    assert watch.look(LIST, waits=False, recording=True, now=2.0) is None
    assert watch.look(LIST, waits=True, now=3.0) is None


def test_a_jumper_who_was_called_and_skipped_is_named_until_the_next_recording() -> None:
    watch = Unrecorded()
    assert watch.look(_skipped(2), waits=False, now=0.0) is None
    assert watch.look(_skipped(2), waits=True, now=1.0) is None, "that was before it was armed"
    assert watch.look(LIST, waits=True, now=2.0) is None
    said = watch.look(_skipped(1), waits=True, now=3.0)
    assert said is not None
    assert said.text == "1 Jumper 1 was called, and nothing was recorded: the last jump may not be recorded"
    assert watch.look(LIST, waits=True, now=4.0) is None, "it was undone"
    assert watch.look(_skipped(1), waits=True, now=5.0) == said
    assert watch.look(_skipped(1), waits=False, now=6.0) is None
    assert watch.look(_skipped(1), waits=True, now=7.0) is None
