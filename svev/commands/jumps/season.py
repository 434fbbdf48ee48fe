"""`svev season`: many logs measured together, and what they say together."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final

import typer

from svev import console

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

CampaignPath = Annotated[Path, typer.Argument(metavar="CAMPAIGN.toml", help="file of the campaign", show_default=False)]
_FEW: Final = 20  # logs that were passed over, which are named


@app.callback()
def season() -> None:
    """Measure the logs of a whole season, ask the tables that come of it, compare athletes, days and hills.

    Example: svev season run season.toml
    """


@app.command("run", no_args_is_help=True)
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

    Exit codes: 0 done, also if some logs could not be measured, which are named; 2 bad input; 4 the disk refuses; 6 the
    Dask scheduler is gone.

    Example: svev season run season.toml --workers 4
    """
    from season.campaign import read_campaign  # noqa: PLC0415 - the help starts at once
    from season.running.run import alone, measure_logs  # noqa: PLC0415

    read = read_campaign(campaign)
    chosen = {"scheduler": scheduler, "workers": workers, "memory_gb": memory_gb}
    cluster = read.cluster.model_copy(update={name: value for name, value in chosen.items() if value is not None})
    read = read.model_copy(update={"cluster": cluster})
    with alone(read), _Progress(as_json) as bar:
        logs, state = measure_logs(read, again=again, dashboard=dashboard, started=bar.start, progress=bar.tick)
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
    """A progress bar that begins when the number of logs to measure is known."""

    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._stack = ExitStack()
        self._tell: Callable[[int], None] | None = None

    def __enter__(self) -> "_Progress":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def start(self, logs: int, threads: int, dashboard: str | None) -> None:
        """Show it."""
        shown = f"; dashboard: {dashboard}" if dashboard else ""
        console.say(f"measuring {logs} logs on {threads} processors{shown}", aside=self._as_json)
        self._tell = self._stack.enter_context(console.progress("measuring", logs))

    def tick(self, done: int) -> None:
        """So many logs are done."""
        if self._tell is not None:
            self._tell(done)
