"""Prints what commands say: lines for people, a progress bar for long work, one JSON object with `--json`.

Names of cameras, sessions and files come from elsewhere. Whatever they hold is shown and never obeyed by a terminal:
everything that people read goes through `visible`.
"""

import json
import os
import sys
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Final, cast

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from rig.errors import StorageError
from rig.phrase import escaped


class _Stderr:
    """Standard error as it is now. That its reader is gone, or its disk is full, never ends what is being done."""

    def write(self, text: str) -> int:
        with suppress(OSError):
            sys.stderr.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            sys.stderr.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)


#: For people; with `--json` only the JSON object goes to standard output.
_stderr = Console(file=cast("IO[str]", _Stderr()), stderr=True, highlight=False, soft_wrap=True, emoji=False)
_stdout = Console(highlight=False, soft_wrap=True, emoji=False)

#: Categories of characters that a terminal obeys or that change how others look: controls, formats, line ends.
_OBEYED: Final = frozenset({"Cc", "Cf", "Zl", "Zp"})


def visible(text: str) -> str:
    """The text as one line; characters that a terminal would obey are written out, as Python does in literals."""
    text = escaped(text)
    if text.isprintable():
        return text
    return "".join(
        each.encode("unicode_escape").decode("ascii") if unicodedata.category(each) in _OBEYED else each
        for each in text
    )


@contextmanager
def _to_standard_output() -> Iterator[None]:
    """Say what cannot be written: what a command has done is done, and no path of its own is at fault.

    Raises:
        StorageError: the disk behind standard output refuses.
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise StorageError(
            f"standard output: cannot be written ({error.strerror}); make room there, or write it elsewhere"
        ) from None


def say(line: str, *, aside: bool = False) -> None:
    """Print one line for people; `aside`: on standard error, beside a result on standard output."""
    if aside:
        _stderr.print(visible(line), markup=False)
        return
    with _to_standard_output():
        _stdout.print(visible(line), markup=False)


def say_if_heard(line: str) -> None:
    """Print one line for people of a program that goes on: that nobody can read it ends nothing."""
    try:
        sys.stdout.write(visible(line) + "\n")
        sys.stdout.flush()
    except OSError:  # what is left of the line would fail again at the end of the program
        with Path(os.devnull).open("w", encoding="utf-8") as nothing:
            os.dup2(nothing.fileno(), sys.stdout.fileno())


def say_text(text: str) -> None:
    """Print lines for people that are already put together."""
    for line in text.split("\n"):
        say(line)


def say_marked(mark: str, style: str, line: str) -> None:
    """Print one indented line for people after a coloured mark, e.g. PASS."""
    with _to_standard_output():
        _stdout.print(Text.assemble("  ", (mark, style), "  ", visible(line)))


def print_json(result: Mapping[str, object]) -> None:
    """Print the result as one JSON object, the last thing on standard output."""
    with _to_standard_output():
        sys.stdout.write(json.dumps(result, indent=2) + "\n")


def print_json_line(result: Mapping[str, object]) -> None:
    """Print one of many results as a JSON object on one line, at once."""
    with _to_standard_output():
        sys.stdout.write(json.dumps(result) + "\n")


def complain(line: str) -> None:
    """Print an error as one line on standard error."""
    _stderr.print(f"svev: {visible(line)}", style="bold red", markup=False)


@contextmanager
def steps() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar for the step that is being done; show nothing if standard error is not a terminal.

    Yields:
        A function to call with the step in words, and the share of it that is done, 0 to 1.
    """
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=_stderr, disable=not _stderr.is_terminal, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        last = ""

        def show(step: str, share: float) -> None:
            nonlocal last
            if step != last:
                bar.reset(task, total=1.0, description=visible(step))
                last = step
            bar.update(task, completed=share)

        yield show


@contextmanager
def progress(label: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on standard error; show nothing if that is not a terminal.

    Args:
        label: the work, in a few words.
        total: number of steps, None if unknown.

    Yields:
        A function to call with the number of steps done so far.
    """
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=_stderr, disable=not _stderr.is_terminal, transient=True) as bar:
        task = bar.add_task(visible(label), total=total)
        yield lambda done: bar.update(task, completed=done)
