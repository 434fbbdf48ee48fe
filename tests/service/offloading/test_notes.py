"""What was copied is remembered, as it was then."""

from pathlib import Path

from rig.api.statement import Level, Statement
from rig.events import Event
from service.offloading.notes import NAME, CopyNotes, mark_of

FAILED = Statement(level=Level.WARNING, code="", text="no disk")


def test_a_recording_is_copied_until_it_or_anything_beside_it_changes(tmp_path: Path) -> None:
    log, said = tmp_path / "jump.mcap", list[Event]()
    log.write_bytes(b"frames")
    notes = CopyNotes(tmp_path, said.append)
    assert not notes.is_copied(log)
    notes.note(log, mark_of(log), FAILED)
    assert not notes.is_copied(log)
    notes.note(log, mark_of(log), None)
    assert CopyNotes(tmp_path, said.append).is_copied(log)
    results = tmp_path / "jump.measured"
    results.mkdir()
    (results / "report.html").write_text("one")
    assert not notes.is_copied(log)
    notes.note(log, mark_of(log), None)
    (results / "report.html").write_text("three")
    assert not notes.is_copied(log)
    assert not said


def test_recordings_that_are_gone_are_forgotten_and_a_broken_file_is_said(tmp_path: Path) -> None:
    one, two, said = tmp_path / "one.mcap", tmp_path / "two.mcap", list[Event]()
    for log in (one, two):
        log.write_bytes(b"frames")
        CopyNotes(tmp_path, said.append).note(log, mark_of(log), None)
    one.unlink()
    notes = CopyNotes(tmp_path, said.append)
    notes.note(two, mark_of(two), FAILED)
    assert (notes.of("one"), notes.of("two") is not None) == (None, True)
    (tmp_path / NAME).write_text("{")
    assert CopyNotes(tmp_path, said.append).of("two") is None
    assert said[0].message.startswith(f"{NAME}: cannot be read (")
