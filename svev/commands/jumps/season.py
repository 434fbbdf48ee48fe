"""`svev season`: many logs measured together, and what they say together."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rig.errors import BadInputError
from rig.host.endings import interrupted_by_endings
from svev import console

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

CampaignPath = Annotated[Path, typer.Argument(metavar="CAMPAIGN.toml", help="file of the campaign", show_default=False)]
_FEW: Final = 20  # logs that were passed over, which are named


@app.callback()
def season() -> None:
    """Measure the logs of a whole season, ask the tables that come of it, compare athletes, days and hills.

    Example: svev season run season.toml
    """


@app.command("run", short_help="Measure all logs of a campaign.", no_args_is_help=True)
def run_command(
    campaign: CampaignPath,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers measure, as tcp://host:8786")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="processes on this computer [default: its cores]")
    ] = None,
    memory_gb: Annotated[
        float | None, typer.Option("--memory", metavar="GB", min=0.5, help="the most memory of a worker")
    ] = None,
    dashboard: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="where Dask's dashboard answers; port 0: any free one")
    ] = "127.0.0.1:0",
    again: Annotated[bool, typer.Option("--again", help="try those logs again that could not be measured")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Measure all logs of a campaign that are not measured yet, then make its tables and its page.

    The result of a log is written beside it, into a folder with the ending .season. It counts as long as the log, the
    survey and the version of svev are the same, so the same command goes on after any interruption.

    Exit codes: 0 done, also if some logs could not be measured, which are named; 2 bad input; 4 the disk refuses, or
    the store has ceased to answer; 6 the Dask scheduler is gone; 130 interrupted.

    Example: svev season run season.toml --workers 4
    """
    from season.campaign import read_campaign  # noqa: PLC0415 - the help starts at once
    from season.page.page import NAME, write_page  # noqa: PLC0415
    from season.running.run import alone, measure_logs  # noqa: PLC0415
    from season.tables.database import build  # noqa: PLC0415

    read = read_campaign(campaign)
    chosen = {"scheduler": scheduler, "workers": workers, "memory_gb": memory_gb}
    cluster = read.cluster.model_copy(update={name: value for name, value in chosen.items() if value is not None})
    read = read.model_copy(update={"cluster": cluster})
    memory = None if cluster.scheduler else f"{cluster.memory_gb:g} GB"
    with interrupted_by_endings(), alone(read), _Progress(memory, as_json=as_json) as bar:
        try:
            logs, state = measure_logs(read, again=again, dashboard=dashboard, started=bar.start, progress=bar.tick)
        except KeyboardInterrupt:
            bar.say_what_stays()
            raise
        bar.close()
        if build(read, logs) or not (read.out / NAME).exists():
            write_page(read.out)
    counts = state.counts
    failed = {url: entry.problem for url, entry in state.logs.items() if entry.problem is not None}
    for url, problem in list(failed.items())[:_FEW]:
        console.say(f"passed over: {url}: {problem}", aside=as_json)
    if len(failed) > _FEW:
        console.say(f"and {len(failed) - _FEW} more, see {read.out / 'state.json'}", aside=as_json)
    jumps = sum(entry.jumps for entry in state.logs.values())
    console.say(
        f"{len(logs)} logs: {counts['done']} measured, {counts['failed']} passed over; {jumps} jumps", aside=as_json
    )
    if as_json:
        console.print_json(
            {
                "campaign": read.name,
                "out": str(read.out),
                "logs": len(logs),
                "jumps": jumps,
                **counts,
                "problems": failed,
            }
        )


class _Progress:
    """A progress bar that begins when the number of logs to measure is known.

    Args:
        memory: the most memory of a worker of this computer, in words.
        as_json: whether standard output is for JSON.
    """

    def __init__(self, memory: str | None, *, as_json: bool) -> None:
        self._memory = memory
        self._as_json = as_json
        self._stack = ExitStack()
        self._tell: Callable[[int], None] | None = None
        self._logs = self._done = 0

    def __enter__(self) -> "_Progress":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Take it away."""
        self._stack.close()

    def start(self, logs: int, threads: int, dashboard: str | None) -> None:
        """Show it."""
        each = f" with at most {self._memory} of memory each" if self._memory else ""
        shown = f"{each}; dashboard: {dashboard}" if dashboard else each
        console.say(f"measuring {logs} logs on {threads} processors{shown}", aside=self._as_json)
        self._logs = logs
        self._tell = self._stack.enter_context(console.progress("measuring", logs))

    def tick(self, done: int) -> None:
        """So many logs are done."""
        self._done = done
        if self._tell is not None:
            self._tell(done)

    def say_what_stays(self) -> None:
        """Somebody ends the run before its end."""
        self.close()
        stays = f"what came of {self._done} of {self._logs} logs lies beside them and stays"
        console.say(f"interrupted: {stays}; run the same command again, and it goes on with the others", aside=True)


PlaceOption = Annotated[
    Path, typer.Option("--in", metavar="PLACE", help="campaign's file, or its folder with season.duckdb")
]


@app.command("query", short_help="Ask the tables of a season.", no_args_is_help=True)
def query_command(
    sql: Annotated[str | None, typer.Argument(metavar="SQL", help="statement of DuckDB", show_default=False)] = None,
    place: PlaceOption = Path(),
    ask: Annotated[
        str | None, typer.Option(metavar="NAME", help="a ready question: athletes, jumps, look, best, failed, cameras")
    ] = None,
    quantity: Annotated[
        str, typer.Option(metavar="NAME", help="of --ask athletes: alpha, height, speed, ...")
    ] = "alpha",
    distance: Annotated[int, typer.Option(metavar="M", help="of it: 0, 5, 10, 15 or 20 m from the take-off")] = 10,
    by: Annotated[
        str, typer.Option(metavar="NAMES", help="of it: athlete, and hill, gate, season, separated by commas")
    ] = "athlete,hill",
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Ask the tables of a season: jumps, pulses, cameras, logs (columns: docs/how-to/season.md). Changes nothing.

    `--ask athletes` gives means with their sigma, and a star where an athlete differs from the others of the same days,
    corrected for how many are compared.

    Exit codes: 0 answered; 2 bad input.

    Example: svev season query "SELECT athlete, count(*) FROM jumps GROUP BY ALL" --in season.toml

    Example: svev season query --ask athletes --quantity alpha --distance 10 --by athlete,hill,gate,season
    """
    from season.tables.comparison import groups  # noqa: PLC0415
    from season.tables.database import asked, opened  # noqa: PLC0415
    from season.tables.questions import QUESTIONS  # noqa: PLC0415
    from svev.commands.jumps.season_tables import aligned, group_rows  # noqa: PLC0415

    if bool(sql) == bool(ask):
        raise BadInputError(f"give either SQL or --ask with one of athletes, {', '.join(QUESTIONS)}")
    with opened(_folder(place)) as database:
        began = time.perf_counter()
        if ask == "athletes":
            columns, rows = group_rows(groups(database, quantity, distance, by.replace(" ", "").split(",")))
        elif ask and ask not in QUESTIONS:
            raise BadInputError(f"{ask}: there is no such question; ask one of athletes, {', '.join(QUESTIONS)}")
        else:
            columns, rows = asked(database, sql or QUESTIONS[ask or ""].sql)
        took_ms = 1e3 * (time.perf_counter() - began)
    if as_json:
        console.print_json({"columns": columns, "rows": [[_plain(cell) for cell in row] for row in rows]})
        return
    for line in aligned(columns, rows):
        console.say(line)
    console.say(f"{len(rows)} rows in {took_ms:.0f} ms", aside=True)


@app.command("compare", short_help="Compare athletes and hills.")
def compare_command(
    place: PlaceOption = Path(),
    quantity: Annotated[str, typer.Option(metavar="NAME", help="alpha, height, speed, ...")] = "alpha",
    distance: Annotated[int, typer.Option(metavar="M", help="0, 5, 10, 15 or 20 m from the take-off")] = 10,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Compare athletes and hills by all good jumps at once, with mixed effects: athlete, day and hill.

    A star marks an effect beyond twice its standard deviation. With 10 000 jumps it takes a minute or two.

    Exit codes: 0 compared; 2 bad input, or the jumps are too few, or do not tell the effects apart.

    Example: svev season compare --quantity alpha --distance 10 --in season.toml
    """
    from season.rows import unit_of  # noqa: PLC0415
    from season.tables.database import opened  # noqa: PLC0415
    from season.tables.mixed_effects import mixed_effects  # noqa: PLC0415
    from svev.commands.jumps.season_tables import effect_lines  # noqa: PLC0415

    with opened(_folder(place)) as database:
        found = mixed_effects(database, quantity, distance)
    if as_json:
        console.print_json({"quantity": quantity, "distance_m": distance, "unit": unit_of(quantity), **asdict(found)})
        return
    for line in effect_lines(found, unit_of(quantity)):
        console.say(line)


def _folder(place: Path) -> Path:
    """The folder of a campaign, which may be given by its file."""
    from season.campaign import read_campaign  # noqa: PLC0415

    return read_campaign(place).out if place.suffix == ".toml" else place


def _plain(cell: Any) -> Any:
    """A cell as JSON can hold it."""
    return cell.isoformat() if isinstance(cell, date) else cell
