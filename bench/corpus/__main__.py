"""Measures scenes of the corpus: `python -m bench.corpus` (`make corpus`). See docs/explanation/corpus.md."""

import argparse
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

import msgspec

from bench.corpus.draws import PIXELS_MOST, Half, draw
from bench.corpus.judging import Row, judge
from bench.corpus.tables import GROUPS, summed, table
from bench.results import write_results
from rig.errors import BadInputError

_HOUSE: Final = Path(__file__).parents[2]
_CACHE: Final = _HOUSE / ".cache" / "corpus"
_RESULTS: Final = _HOUSE / "bench" / "results"
_RENDERERS: Final = ("hill", "drawn", "path-traced")
#: The rooms whose code decides what a row holds.
_ROOMS: Final = ("analysis", "photogrammetry", "simrig", "recorder", "rig", "bench/corpus", "bench/analysis")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the scenes that are asked for, print the table, keep it as JSON."""
    asked = _parser().parse_args(arguments)
    halves = list(Half) if asked.half == "both" else [Half(asked.half)]
    cache = None if asked.fresh else asked.cache / _digest(asked.pixels)
    drawn = {"first": asked.first, "scenes": asked.scenes, "pixels": asked.pixels}
    kind = f"-{asked.renderer}" if asked.renderer else ""
    for half in halves:
        numbers = range(asked.first, asked.first + asked.scenes)
        rows = []
        try:
            for row in measured(half, numbers, asked.pixels, asked.workers, cache, asked.renderer):
                rows.append(row)
                done = f"{len(rows)} of {asked.scenes}"
                print(f"{half}: {done}" if half is Half.HELD_OUT else f"{half}: {done}: {said(row)}", flush=True)
        except BadInputError as error:  # no Blender
            raise SystemExit(str(error)) from error
        name = f"corpus-{half}{kind}"
        before = _before(asked.results / f"{name}.json", drawn)
        print(*table(rows, before), sep="\n")
        groups = {group: msgspec.to_builtins(summed([*filter(of, rows)])) for group, of in GROUPS.items()}
        print(write_results(name, [{**drawn, "groups": groups}], asked.results))


def measured(
    half: Half, numbers: range, pixels_most: int, workers: int, cache: Path | None, renderer: str | None = None
) -> Iterator[Row]:
    """Rows of scenes, in order, each from the cache if the code has not changed since.

    Args:
        half: of the corpus.
        numbers: of the scenes.
        pixels_most: see `bench.corpus.draws.draw`.
        workers: processes at a time.
        cache: folder of the rows of this state of the code; None: nothing is kept.
        renderer: of all scenes; None: each has the one that is drawn for it.
    """
    jobs = [(half, number, pixels_most, cache, renderer) for number in numbers]
    if workers == 1:
        yield from map(_row, jobs)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(_row, jobs)


def said(row: Row) -> str:
    """A row as a line of text."""
    scene = f"{row.number}: {row.cameras} cameras, {row.width} px, markers {row.marker_px:.1f} px, {row.renderer}"
    if row.error:
        return f"{scene}: {row.error}"
    verdict = "measured well" if row.well else "not measured well"
    return (
        f"{scene}: {verdict}, {row.jumps} jumps, points {row.solved} of {row.points}, {row.wrong} wrong, "
        f"skis {row.skis_solved} of {row.skis}, {row.skis_wrong} wrong, {row.cpu_s:.1f} CPU-s"
    )


def _row(job: tuple[Half, int, int, Path | None, str | None]) -> Row:
    half, number, pixels_most, cache, renderer = job
    kept = None if cache is None else cache / f"{half}-{number}{f'-{renderer}' if renderer else ''}.json"
    if kept is not None and kept.exists():
        return msgspec.json.decode(kept.read_bytes(), type=Row)
    with tempfile.TemporaryDirectory(prefix="svev-corpus-") as folder:
        scene = draw(half, number, pixels_most)
        row = judge(replace(scene, renderer=renderer or scene.renderer), Path(folder))
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}")
        part.write_bytes(msgspec.json.encode(row))
        part.replace(kept)
    return row


def _digest(pixels_most: int) -> str:
    """Names the state of the code that a row depends on."""
    digest = blake2b(str(pixels_most).encode(), digest_size=8)
    for room in _ROOMS:
        for module in sorted((_HOUSE / room).rglob("*.py")):
            digest.update(module.relative_to(_HOUSE).as_posix().encode() + module.read_bytes())
    return digest.hexdigest()


def _before(path: Path, drawn: dict[str, int]) -> dict[str, Any] | None:
    """The groups of the run before, if it measured the same scenes."""
    if not path.exists():
        return None
    (case,) = msgspec.json.decode(path.read_bytes())["cases"]
    groups: dict[str, Any] = case.pop("groups")
    return groups if case == drawn else None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m bench.corpus", description=__doc__)
    parser.add_argument("--half", choices=[*Half, "both"], default=Half.WORK.value, help="which scenes (work)")
    parser.add_argument("--scenes", type=int, default=40, metavar="N", help="how many (40)")
    parser.add_argument("--first", type=int, default=0, metavar="N", help="number of the first one (0)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N", help="processes at a time")
    parser.add_argument("--pixels", type=int, default=PIXELS_MOST, metavar="N", help="pixels of a log at most")
    parser.add_argument("--renderer", choices=_RENDERERS, help="of all scenes (each has the one that is drawn for it)")
    parser.add_argument("--fresh", action="store_true", help="measure all anew, keep no rows")
    parser.add_argument("--cache", type=Path, default=_CACHE, metavar="FOLDER", help="of rows that are kept")
    parser.add_argument("--results", type=Path, default=_RESULTS, metavar="FOLDER", help="of the tables as JSON")
    return parser


if __name__ == "__main__":
    main()
