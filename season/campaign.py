"""The file of a campaign (TOML): whose logs are measured together, by which surveys, on which processors."""

from datetime import date
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, model_validator

from rig.settings.store_options import StoreOptions
from rig.settings.strict_toml import StrictModel, read_toml, validate

Text = Annotated[str, Field(min_length=1, max_length=200)]
#: A path, relative to the campaign's file, or an address of an object store such as `s3://bucket/hill`.
Place = Annotated[str, Field(min_length=1)]
_GB: Final = 1e9


class Source(StrictModel):
    """What orients the cameras.

    Attributes:
        survey: survey of the balls with the interior orientations.
        calibration: poses of the cameras, a result of `svev orient`.
    """

    survey: Path | None = None
    calibration: Path | None = None

    @model_validator(mode="after")
    def _is_one(self) -> "Source":
        if (self.survey is None) == (self.calibration is None):
            raise ValueError("give either survey or calibration")
        return self


class Days(Source):
    """What orients the cameras on some days.

    Attributes:
        first: the first day, UTC.
        last: the last one.
    """

    first: date
    last: date

    @model_validator(mode="after")
    def _is_in_order(self) -> "Days":
        if self.last < self.first:
            raise ValueError(f"last = {self.last} is before first = {self.first}; exchange them")
        return self


class Hill(Source):
    """A hill with its logs.

    Attributes:
        name: of the hill.
        logs: folders, which are searched with all below them, logs, or patterns with `*`, `?` and `**`.
        days: days that have a survey or a calibration of their own.
    """

    name: Text
    logs: Annotated[tuple[Place, ...], Field(min_length=1)]
    days: tuple[Days, ...] = ()


class Cluster(StrictModel):
    """The processors.

    Attributes:
        workers: processes on this computer, each with one thread; 0: as many as there are cores.
        memory_gb: the most memory of a worker of this computer, GB (10^9 bytes); one that takes more is ended.
        scheduler: address of a Dask scheduler with workers elsewhere, instead of this computer's cores.
    """

    workers: Annotated[int, Field(ge=0, le=1024)] = 0
    memory_gb: Annotated[float, Field(gt=0.0)] = 3.0
    scheduler: Text | None = None

    @property
    def memory_bytes(self) -> int:
        """The most memory of a worker."""
        return round(self.memory_gb * _GB)


class Campaign(StrictModel):
    """A campaign.

    Attributes:
        name: for people.
        out: folder for tables, page and state, relative to the file.
        store: options of the object stores, as fsspec takes them (`endpoint_url`, `anon`, ...); no secrets.
        hills: with their logs.
        cluster: the processors.
    """

    name: Text
    out: Path
    store: StoreOptions = Field(default_factory=dict)
    hills: Annotated[tuple[Hill, ...], Field(min_length=1)]
    cluster: Cluster = Cluster()

    @model_validator(mode="after")
    def _names_differ(self) -> "Campaign":
        names = [hill.name for hill in self.hills]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"two hills are called {min(twice)!r}; join their logs, or rename one")
        return self


def read_campaign(path: Path) -> Campaign:
    """Read the file; its relative paths become those of the folder in which it lies.

    Raises:
        BadInputError: it is missing, or something in it is wrong.
    """
    campaign = validate(Campaign, read_toml(path, kind="campaign"), path)
    folder = path.resolve().parent
    hills = tuple(
        hill.model_copy(
            update={
                **_placed(hill, folder),
                "logs": tuple(each if "://" in each else str(folder / each) for each in hill.logs),
                "days": tuple(days.model_copy(update=_placed(days, folder)) for days in hill.days),
            }
        )
        for hill in campaign.hills
    )
    return campaign.model_copy(update={"out": folder / campaign.out, "hills": hills})


def _placed(source: Source, folder: Path) -> dict[str, Path | None]:
    return {
        "survey": source.survey and folder / source.survey,
        "calibration": source.calibration and folder / source.calibration,
    }
