"""`svev info`, `svev verify`, `svev recover`: say what a log holds, check it, make a whole log of it."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from recorder.checking.verify import Verdict, VerifyReport, verify
from recorder.reading.info import LogInfo, compacted_in_words, imported_in_words, info, merged_in_words
from recorder.recovering.recover import RecoverReport, recover
from rig.clocks import NS_PER_S
from rig.errors import BadInputError, LedgerDiffersError, LogDamagedError, LogTruncatedError
from service.recordings import live_results
from svev import console
from triggering.ledger.recounted import Difference, Recounted

_LINES_MAX = 60

LogPath = Annotated[Path, typer.Argument(metavar="LOG", help="the log, a .mcap file", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object instead")]
AlsoJson = Annotated[bool, typer.Option("--json", help="end with one JSON object")]


def check_pulses(first: int | None, last: int | None) -> None:
    """Refuse `--from` behind `--to`.

    Raises:
        BadInputError: there is no pulse between them.
    """
    if first is not None and last is not None and first > last:
        raise BadInputError(f"--from {first} --to {last}: ends before it begins; exchange the two")


def info_command(log: LogPath, as_json: AsJson = False) -> None:
    """Say what a log holds: pulses, ledger of each camera, rate, spread of the triggers, session, rig.

    Where the source of the pulses tells of them (a trigger box, a line of the computer), its count stands beside that
    of the tags. Tells of the jumps too that were measured while it was recorded. Reads no images and so takes a moment
    even for a long log; `svev verify` checks every byte.

    Exit codes: 0; 2 no such file, no log of svev, or truncated; 3 the log was not closed, is still being written, is
    damaged, or is not its whole recording (it ended early, or goes on from one, or in one, that does not lie beside
    it). What can be read is printed in any case.

    Example: svev info recordings/jump.mcap
    """
    found, jumps = info(log, source=True), live_results.summaries(log)
    if as_json:
        console.print_json(found.to_json() | {"jumps": [jump.model_dump(mode="json") for jump in jumps]})
    else:
        for name, text in (*_lines(found), *((f"jump {jump.jump}", jump.verdict) for jump in jumps)):
            console.say(f"{name:<10} {text}")
    if found.being_written:
        raise LogDamagedError(f"{log}: the log is still being written: look at it when the recording has ended")
    if found.truncated:
        raise truncated(log)
    if not found.closed:
        raise LogDamagedError(f"{log}: the log was not closed; check it with `svev verify`")
    if found.damaged_bytes:
        raise LogDamagedError(f"{log}: {found.damaged_bytes} bytes are damaged; see which pulses with `svev verify`")
    _refuse_a_part(log, found.ended_early, found.part_before, found.part_after)


def verify_command(
    log: LogPath,
    with_ledger: Annotated[
        bool, typer.Option("--ledger", help="recompute what became of every pulse, and compare with the tags")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Check every byte of a log and say, pulse by pulse, what is missing.

    Checks checksums, message indexes, summary and statistics, compares tags with images, and looks for pulses without
    a tag and for pauses: time without a pulse. The verdict is "clean" (every pulse complete, no pause), "partial" (the
    log is sound; its tags say which frames are missing and why, and the times of its pulses where there is a pause),
    "contradicted" (the log is sound, but numbers and times of frames say that they are of other pulses than their tags
    say: the pulses and cameras are named) or "damaged" (not closed, unreadable in part, or inconsistent).

    With --ledger it also prints what became of every pulse in every camera by frame numbers, clocks, arrivals and
    trigger counts, and names each missing frame whose tag says another cause. Where the log holds what the source of
    the pulses told (a trigger box, a line of the computer), that is compared as well.

    Exit codes: 0 clean or partial; 2 no such file, no log of svev, or truncated; 3 damaged otherwise (a killed recorder
    leaves an unclosed log), still being written, or not the whole recording (it ended early, its end is not known, or
    it goes on from a log that does not lie beside it); 7 sound, but contradicted, with --ledger also where only a cause
    is. What can be read is printed in any case.

    Example: svev verify recordings/jump.mcap
    """
    with console.progress("checking", _size(log)) as done:
        report = verify(log, done)
    if as_json:
        recounted = {"ledger": report.recounted.to_json()} if with_ledger else {}
        console.print_json(report.to_json() | recounted)
    else:
        _print_verified(report, () if with_ledger else report.recounted.misfiled)
        if with_ledger:
            _print_recounted(report.recounted)
    if report.truncated and not report.being_written:
        raise truncated(log)
    if report.damaged:
        raise LogDamagedError(f"{log}: damaged: {_first_flaw(report)}; the pulses counted above are readable")
    contradicted = report.verdict is Verdict.CONTRADICTED
    if contradicted or (with_ledger and not report.recounted.agrees):
        first = report.recounted.misfiled[0].in_words() if contradicted else next(report.recounted.in_words())
        raise LedgerDiffersError(
            f"{log}: its ledger does not agree with its tags: {first}; measure nothing at the pulses that are named, "
            "and look at the events of that time"
        )
    _refuse_a_part(log, report.ended_early, report.part_before, report.part_after)


def recover_command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="the log; it is only read", show_default=False)],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="LOG", help="the new log; must not exist", show_default=False)
    ],
    as_json: AlsoJson = False,
) -> None:
    """Make a whole log of one that was not closed or is damaged: closed, indexed, everything in it checked.

    Copies everything that is sound. If the image of a pulse is destroyed but not its tag, the tag is kept, and calls
    the frames that the image had "damaged". Prints what is lost, and writes it into the new log too.

    Exit codes: 0 everything in the log is in the new one (whether that is the whole recording, `svev verify` of the
    new one says); 2 no such file, or no pulse in it that can be read, or the new log cannot be made;
    3 recovered, but something was lost, or the log is still being written; 4 the disk is full or fails.

    Example: svev recover recordings/jump.mcap -o recordings/jump-recovered.mcap
    """
    with console.progress("recovering", _size(log)) as done:
        report = recover(log, out, done)
    if as_json:
        console.print_json(report.to_json())
    else:
        _print_recovered(report)
    if not report.lossless:
        raise LogDamagedError(f"{log}: recovered into {out}, but this is lost: {report.in_words()}")
    if report.was_written:
        raise LogDamagedError(
            f"{log}: recovered into {out}, but it is still being written: recover it again when the recording has ended"
        )


def _refuse_a_part(log: Path, ended_early: str, part_before: str, part_after: str) -> None:
    """Say by the exit code that a sound log does not hold its whole recording.

    Raises:
        LogDamagedError: it ended early, or the log before it or after it does not lie beside it.
    """
    for how, part in (("goes on from", part_before), ("goes on in", part_after)):
        if part:
            raise LogDamagedError(
                f"{log}: not the whole recording: {how} {part}, which does not lie beside it: put both into one folder"
            )
    if ended_early:
        raise LogDamagedError(f"{log}: not the whole recording: {ended_early}; what it holds is sound")


def truncated(log: Path) -> LogTruncatedError:
    """The error for a log that ends in the middle of a record; raised when all that can be read has been printed."""
    return LogTruncatedError(
        f"{log}: truncated: it ends in the middle of a record; copy it again from the machine that recorded it, "
        "or use what can be read"
    )


def _size(log: Path) -> int | None:
    """Bytes of the log, for the progress bar; None if there is no such file."""
    return log.stat().st_size if log.is_file() else None


def _lines(found: LogInfo) -> Iterator[tuple[str, str]]:
    """What `svev info` prints, as name and text."""
    ledger, spread = found.ledger, found.ledger.spread.figures()
    yield "log", f"{found.path} ({found.bytes / 1e6:.1f} MB, by {found.library})"
    yield "state", "closed" if found.closed else "not closed"
    yield "recording", found.recording or "no pulse"
    if ledger.first_time is not None:
        start = datetime.fromtimestamp(ledger.first_time / NS_PER_S, UTC)
        yield "first", f"{start:%Y-%m-%d %H:%M:%S.%f} UTC"
    rate = "" if ledger.rate_hz is None else f", {ledger.rate_hz:.3f} Hz"
    yield "duration", f"{ledger.duration_s:.3f} s{rate}"
    yield "pulses", ledger.summary_line()
    for camera, states in ledger.states(found.cameras).items():
        yield "ledger", f"{camera} " + ", ".join(f"{count} {state}" for state, count in states.items())
    if found.source is not None:
        more = "" if found.source.agrees else "; `svev verify --ledger` names each"
        yield "source", found.source.summary_line().removeprefix("the source's ") + more
    if found.missing_pulses:
        yield "no tag", f"{found.missing_pulses} pulses"
    told = (
        ("merged", merged_in_words(found.merged).removeprefix("merged ") if found.merged else ""),
        ("imported", imported_in_words(found.imported).removeprefix("imported ") if found.imported else ""),
        ("compacted", compacted_in_words(found.compacted) if found.compacted else ""),
        ("trouble", found.trouble),
        ("ended early", found.ended_early),
        ("part", str(found.part) if found.part > 1 or found.next_part else ""),
        ("goes on from", f"{found.part_before}, which does not lie beside it" if found.part_before else ""),
        ("goes on in", f"{found.part_after}, which does not lie beside it" if found.part_after else ""),
    )
    yield from ((name, text) for name, text in told if text)
    for pause in ledger.pauses()[:_LINES_MAX]:
        yield "pause", pause.in_words()
    if spread is not None:
        yield "offset", f"{spread['median']} us median, {spread['max']} us at most, from the pulse"
    if found.shape is not None:
        yield "triplet", f"{found.shape[1]} x {found.shape[0]} px of {', '.join(found.cameras)}"
    if found.utc is not None:
        yield "utc", found.utc.in_words()
    elif "utc" in found.rig:
        yield "utc", f"{found.rig['utc']}: {found.rig.get('utc_why', '')}"
    rig = {key: value for key, value in found.rig.items() if not key.startswith("utc")}
    for name, fields in (("session", found.session), ("rig", rig)):
        if text := ", ".join(f"{key} {value}" for key, value in fields.items() if value):
            yield name, text


def _print_verified(report: VerifyReport, misfiled: Sequence[Difference]) -> None:
    ledger = report.ledger
    console.say(f"{report.path}: {report.verdict.value}")
    console.say(f"{ledger.summary_line()}; {report.bytes / 1e6:.1f} MB; {'' if report.closed else 'not '}closed")
    if report.closed and not report.every_byte:
        console.say("  no checksum over the whole log: what stands outside of images, tags and messages is not checked")
    told = (difference.in_words() for difference in misfiled)
    lines = [*report.parts_in_words(), *told, *ledger.in_words(), *report.findings, *report.off_time]
    for line in lines[:_LINES_MAX]:
        console.say(f"  {line}")
    if len(lines) > _LINES_MAX:
        console.say(f"  and {len(lines) - _LINES_MAX} more; see all with --json")
    for event in report.events[:_LINES_MAX]:
        console.say(f"  {event.level.value}: {event.name}: {event.message}")


def _print_recounted(recounted: Recounted) -> None:
    console.say(recounted.summary_line())
    for difference in recounted.differences[:_LINES_MAX]:
        console.say(f"  {difference.in_words()}")
    if recounted.disagreements > _LINES_MAX:
        console.say(f"  and {recounted.disagreements - _LINES_MAX} more; see them with --json")
    if recounted.source is not None:
        console.say(recounted.source.summary_line())
        for finding in recounted.source.findings[:_LINES_MAX]:
            console.say(f"  {finding}")
        if len(recounted.source.findings) > _LINES_MAX:
            console.say(f"  and {len(recounted.source.findings) - _LINES_MAX} more; see them with --json")


def _first_flaw(report: VerifyReport) -> str:
    if report.unclosed:
        return report.unclosed
    if report.findings:
        more = len(report.findings) - 1
        return report.findings[0] + (f" (and {more} more)" if more else "")
    return "pulses have no tag"


def _print_recovered(report: RecoverReport) -> None:
    console.say(f"{report.path}: {report.ledger.summary_line()}; {report.bytes / 1e6:.1f} MB")
    if not report.was_closed:
        console.say(report.end_unknown)
    for finding in report.findings:
        console.say(f"  {finding}")
    console.say(f"check it: svev verify {report.path}")
