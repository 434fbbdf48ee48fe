"""Options of commands whose work can be spread over processors, on the engine of the season."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Annotated

import typer

from rig.each import Each
from svev import console

WorkersOption = Annotated[
    int | None, typer.Option(metavar="N", min=1, help="spread it over so many processes on this computer")
]
SchedulerOption = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="spread it over the workers of this Dask scheduler")
]


@contextmanager
def spread(workers: int | None, scheduler: str | None) -> Iterator[Each]:
    """What applies a function to many arguments: here, one after the other, if neither option is given.

    Raises:
        BadInputError: the scheduler does not answer, or has no workers.
    """
    if workers is None and scheduler is None:
        yield map
        return
    from season.campaign import Cluster  # noqa: PLC0415 - Dask takes a while to be imported
    from season.running.engine import engine, mapped  # noqa: PLC0415

    with engine(Cluster(workers=workers or 0, scheduler=scheduler), "127.0.0.1:0") as on:
        console.say(f"{on.threads} processors; dashboard: {on.dashboard}", aside=True)
        yield partial(mapped, on)
