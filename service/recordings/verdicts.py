"""What a recording is good for, in one line."""

from typing import Final

from recorder.catalogue.entry import Entry, LogState, Trouble
from recorder.log.extent import CONTINUES
from rig.api.statement import Level, Statement
from rig.phrase import Phrase, Value
from rig.pulse import Pause
from triggering.ledger.account import pauses_in_words

#: How the trouble with a file is said; its text ends in what to do.
_TROUBLES: Final = {
    Trouble.HEADLESS: (Level.ERROR, "headless", ""),
    Trouble.LINK: (Level.ERROR, "link", ""),
    Trouble.NO_FILE: (Level.ERROR, "no_file", ""),
    Trouble.SESSION: (Level.ERROR, "session", ""),
    Trouble.UNREADABLE: (Level.ERROR, "trouble", ""),
    Trouble.NONE: (Level.ERROR, "trouble", ""),
}
#: Verdicts on how a recording ended, which are followed by one on its pulses.
_ENDS: Final = frozenset({"disk_full", "ended_early", "forgotten"})
#: Reasons for the end of a log that mean that there was no room for more.
_FULL: Final = frozenset({"disk_full", "disk_quota", "why_disk_reserve"})
#: Reasons that stand behind the path of the log itself.
_BEHIND_PATH: Final = frozenset({"why_disk_refuses", "why_reserve_reached"})
#: What a list repeats of a session field, however long the log has it.
LONGEST_SHOWN: Final = 4000


def verdict(entry: Entry) -> Statement:
    """Say in one line what a recording is good for.

    `values["failures"]` reads e.g. "K2 1 lost, 1 missed; K3 2 absent", `values["rest"]` says of a recording that ended
    by itself what it is good for until then.
    """
    level, code, text, advice = _judge(entry)
    values = _values(entry)
    if code in _ENDS:
        _, rest, words, _ = _judge_account(entry)
        values["rest"] = Phrase(f"verdict_{rest}", words, dict(values))
    return Statement(level=level, code=f"verdict_{code}", text=text, advice=advice, values=values)


def _values(entry: Entry) -> dict[str, Value]:
    return {
        "pulses": entry.pulses, "complete": entry.complete, "partial": entry.partial, "missing": entry.missing,
        "failures": _failures(entry), "pauses": len(entry.pauses),
        "paused_s": round(sum(pause.seconds for pause in entry.pauses), 1), "disk": entry.disk,
        "longest_s": entry.forgotten_s, "trouble": entry.trouble, "why": _reason(entry.ended_early),
        "before": entry.session.get(CONTINUES, "")[:LONGEST_SHOWN],
        "unrecorded": sum(pause.pulses for pause in entry.pauses if pause.between_logs),
    }  # fmt: skip


def _reason(said: Phrase) -> Phrase:
    """Why a log ended early, without its own path."""
    why = said.values.get("why")
    return why if said.code in _BEHIND_PATH and isinstance(why, Phrase) else said


def _judge(entry: Entry) -> tuple[Level, str, str, str]:
    if entry.trouble:
        level, code, advice = _TROUBLES[entry.kind]
        return level, code, entry.trouble, advice
    if entry.state is LogState.DAMAGED:
        text = f"Parts cannot be read or are not there; {entry.pulses} pulses are readable"
        advice = "svev recover makes a proper log of what can be read; svev verify says what is damaged"
        return Level.ERROR, "damaged", text, advice
    if entry.state is LogState.WRITING:
        return Level.INFO, "being_written", f"Another svev is recording it: {entry.pulses} pulses until now", ""
    if entry.state is LogState.UNFINISHED:
        text, advice = f"Never closed; its {entry.pulses} pulses are readable", "svev recover makes a proper log of it"
        return Level.WARNING, "unfinished", text, advice
    return _judge_end(entry)


def _judge_end(entry: Entry) -> tuple[Level, str, str, str]:
    """Judge a sound log: by how it ended, and by its pulses."""
    if not entry.pulses and not entry.ended_early.text:
        return Level.WARNING, "empty", "No pulse came", "Look at the trigger"
    level, code, text, advice = _judge_account(entry)
    if (why := _reason(entry.ended_early)).code in _FULL:
        text = f"The disk was full, and the recording ended early. {text}"
        return Level.WARNING, "disk_full", text, "Delete recordings and empty the trash, or record to another disk"
    if why.text:
        return Level.WARNING, "ended_early", f"Ended early: {why.text[:LONGEST_SHOWN]}. {text}", advice
    if entry.forgotten_s:
        text = f"Ended by itself after {entry.forgotten_s:g} s, because nobody had stopped it. {text}"
        return Level.WARNING, "forgotten", text, advice
    return level, code, text, advice


def _judge_account(entry: Entry) -> tuple[Level, str, str, str]:
    if (before := entry.session.get(CONTINUES, "")) and (gap := _between_logs(entry)) is not None:
        text = f"Goes on from {before[:LONGEST_SHOWN]}: {gap.pulses} pulses are in neither, {gap.seconds:.1f} s"
        text += f"; of its {entry.pulses} pulses {entry.partial} lack a frame"
        return Level.WARNING, "continued", text, "Look at both parts; svev verify says what is missing"
    lacking = f"{entry.partial} of {entry.pulses} pulses lack a frame: {_failures(entry)}"
    if entry.pauses:
        paused = pauses_in_words(entry.pauses)
        advice = "Look at the trigger, and at the cameras' events of that time: svev verify says when"
        if entry.partial:
            return Level.WARNING, "partial_paused", f"{lacking}; {paused}", advice
        return Level.WARNING, "paused", f"{entry.pulses} pulses, all complete, but {paused}", advice
    if entry.partial and entry.disk.text:
        return Level.WARNING, "partial_disk", lacking, entry.disk.text
    if entry.partial:
        return Level.WARNING, "partial", lacking, ""
    return Level.GOOD, "complete", f"Complete: all {entry.pulses} pulses", ""


def _between_logs(entry: Entry) -> Pause | None:
    """The pulses that neither this log has nor the one that it continues, if there are no other pauses."""
    gaps = [pause for pause in entry.pauses if pause.between_logs]
    return gaps[0] if len(gaps) == len(entry.pauses) == 1 else None


def _failures(entry: Entry) -> str:
    cameras = (
        f"{name} " + ", ".join(f"{count} {status.value}" for status, count in causes.items())
        for name, causes in entry.failures.items()
    )
    return "; ".join(cameras)
