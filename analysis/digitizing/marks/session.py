"""The marks of one operator in one log: actions, undo and redo, and what stands at each pulse."""

import threading
from collections.abc import Collection, Iterable, Mapping
from datetime import UTC, datetime

from analysis.digitizing.marks.journal import Entered, Entry, Journal, Key
from analysis.digitizing.marks.things import is_line
from rig.api.digitizing import (
    Action,
    MarkSource,
    MarkState,
    PlaceAction,
    RemoveAction,
    StateAction,
    Touched,
    UndoAction,
)
from rig.errors import BadInputError
from rig.phrase import phrase

#: What stands at one place before and after an action; None: nothing.
_Change = tuple[Key, Entered | None, Entered | None]
_LETTERS = {MarkState.GUESS: "g", MarkState.HIDDEN: "h", MarkState.NOT_VISIBLE: "n"}
_MEASURED = {MarkSource.HAND: "m", MarkSource.REFINED: "r", MarkSource.TRACKED: "t", MarkSource.AUTOMATIC: "a"}


class Session:
    """Marks, kept in a journal. Any thread may call any method.

    The time of an action does not depend on how much is marked.

    Args:
        journal: of this operator and recording.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._pulses: dict[int, dict[Key, Entered]] = {}
        self._coverage: dict[str, dict[str, dict[int, str]]] = {}
        self._done: list[tuple[_Change, ...]] = []
        self._undone: list[tuple[_Change, ...]] = []
        self._touched: list[tuple[_Change, ...]] = []
        self._changed = threading.Condition()
        for entry in journal.entries:
            self._apply(entry)

    @property
    def revision(self) -> int:
        """Number of actions so far, with those that were taken back."""
        return len(self._touched)

    @property
    def undo_depth(self) -> int:
        """So many actions can be taken back."""
        return len(self._done)

    @property
    def redo_depth(self) -> int:
        """So many actions that were taken back can be done again."""
        return len(self._undone)

    def act(self, action: Action) -> Touched | None:
        """Do what a person asked for; it is on the disk when this returns.

        Returns:
            What was changed first; None if nothing was.

        Raises:
            BadInputError: the action does not fit, such as a vertex of a point.
            StorageError: the disk refuses; nothing was changed.
        """
        with self._changed:
            match action:
                case UndoAction(do="undo"):
                    return self._commit(Entry("undo", _now())) if self._done else None
                case UndoAction():
                    return self._commit(Entry("redo", _now())) if self._undone else None
                case PlaceAction():
                    return self._commit(self._placing(action))
                case StateAction():
                    key = Key(action.pulse, action.camera, action.thing)
                    cleared = tuple(k for k in self._of(action.pulse, action.camera, action.thing) if k != key)
                    return self._commit(Entry("change", _now(), ((key, Entered(action.state)),), cleared))
                case RemoveAction():
                    return self._commit(self._removing(action))

    def put(self, marks: Iterable[tuple[Key, Entered]], clear: Collection[Key] = ()) -> Touched | None:
        """Set many marks by one action, such as those of a track or a file; one undo takes all back."""
        entered = tuple(marks)
        if not entered and not clear:
            return None
        with self._changed:
            return self._commit(Entry("change", _now(), entered, tuple(clear)))

    def at(self, pulse: int) -> Mapping[Key, Entered]:
        """What stands at a pulse, a copy."""
        with self._changed:
            return dict(self._pulses.get(pulse, {}))

    def pulses(self) -> list[int]:
        """The pulses with marks, in order."""
        with self._changed:
            return sorted(self._pulses)

    def everything(self) -> list[tuple[Key, Entered]]:
        """All marks, in the order of their keys."""
        with self._changed:
            return sorted((item for marks in self._pulses.values() for item in marks.items()), key=lambda item: item[0])

    def coverage(self) -> dict[str, dict[str, dict[int, str]]]:
        """By thing, camera and pulse, a letter for what stands there."""
        with self._changed:
            return {
                thing: {camera: dict(pulses) for camera, pulses in cameras.items()}
                for thing, cameras in self._coverage.items()
            }

    def changes(self, since: int, wait_s: float) -> tuple[int, list[Touched]]:
        """The revision, and what changed after another one; waits for a change if there is none yet."""
        with self._changed:
            self._changed.wait_for(lambda: self.revision > since, wait_s)
            keys = {(k.pulse, k.camera, k.thing) for changes in self._touched[since:] for k, _, _ in changes}
            return self.revision, [Touched(pulse=p, camera=c, thing=t) for p, c, t in sorted(keys)]

    def close(self) -> None:
        """Let other programs have the journal."""
        self._journal.close()

    def _of(self, pulse: int, camera: str, thing: str) -> list[Key]:
        return [k for k in self._pulses.get(pulse, {}) if k.camera == camera and k.thing == thing]

    def _placing(self, action: PlaceAction) -> Entry:
        there = self._of(action.pulse, action.camera, action.thing)
        stale: tuple[Key, ...] = ()
        if not is_line(action.thing):
            if action.vertex is not None:
                raise BadInputError(
                    phrase("hand_no_line", '{thing} is no line: leave "vertex" out', thing=action.thing)
                )
            key = Key(action.pulse, action.camera, action.thing)
        else:
            last = max((k.vertex for k in there), default=-1)
            vertex = last + 1 if action.vertex is None else action.vertex
            if vertex > last + 1:
                raise BadInputError(
                    phrase(
                        "hand_next_vertex",
                        "{thing} has {count} points here: the next one has the number {count}",
                        thing=action.thing,
                        count=last + 1,
                    )
                )
            key = Key(action.pulse, action.camera, action.thing, vertex)
            stale = tuple(k for k in there if k.vertex < 0)
        xy = (round(action.xy[0], 4), round(action.xy[1], 4))
        return Entry("change", _now(), ((key, Entered(action.state, xy, action.sigma, action.source)),), stale)

    def _removing(self, action: RemoveAction) -> Entry:
        there = sorted(self._of(action.pulse, action.camera, action.thing))
        if action.vertex is None:
            return Entry("change", _now(), (), tuple(there))
        marks = self._pulses.get(action.pulse, {})
        rest = [marks[k] for k in there if k.vertex not in {action.vertex, -1}]
        kept = tuple((Key(action.pulse, action.camera, action.thing, i), mark) for i, mark in enumerate(rest))
        return Entry("change", _now(), kept, tuple(there[len(kept) :]))

    def _commit(self, entry: Entry) -> Touched | None:
        """Keep an entry, then make it true."""
        if entry.do == "change" and not entry.set and not entry.clear:
            return None
        self._journal.append(entry)
        changes = self._apply(entry)
        self._changed.notify_all()
        if not changes:
            return None
        key = changes[0][0]
        return Touched(pulse=key.pulse, camera=key.camera, thing=key.thing)

    def _apply(self, entry: Entry) -> tuple[_Change, ...]:
        match entry.do:
            case "change":
                wanted: dict[Key, Entered | None] = dict.fromkeys(entry.clear)
                wanted.update(entry.set)
                changes = tuple((key, self._get(key), after) for key, after in wanted.items())
                self._done.append(changes)
                self._undone.clear()
            case "undo":
                last = self._done.pop()
                self._undone.append(last)
                changes = tuple((key, after, before) for key, before, after in reversed(last))
            case "redo":
                changes = self._undone.pop()
                self._done.append(changes)
        for key, _, after in changes:
            self._set(key, after)
        self._touched.append(changes)
        return changes

    def _get(self, key: Key) -> Entered | None:
        return self._pulses.get(key.pulse, {}).get(key)

    def _set(self, key: Key, entered: Entered | None) -> None:
        if entered is not None:
            self._pulses.setdefault(key.pulse, {})[key] = entered
        elif key.pulse in self._pulses:
            self._pulses[key.pulse].pop(key, None)
            if not self._pulses[key.pulse]:
                del self._pulses[key.pulse]
        there = [self._pulses[key.pulse][k] for k in self._of(key.pulse, key.camera, key.thing)]
        pulses = self._coverage.setdefault(key.thing, {}).setdefault(key.camera, {})
        if there:
            pulses[key.pulse] = _LETTERS.get(there[0].state) or _MEASURED[there[0].source]
        else:
            pulses.pop(key.pulse, None)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
