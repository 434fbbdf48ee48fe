"""The logs of a campaign: where they are, what orients their cameras, what came of them before."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Final

from recorder.reading.parts import parts_of
from rig.errors import BadInputError
from season.campaign import Campaign, Hill, Source
from season.running.outcome import Orienting, Outcome, decoded, read_orienting
from season.running.stores import Entry, is_remote, listed, read_outcomes

#: The recorder names a log by the time at which it was opened, UTC.
_DAY: Final = re.compile(r"(\d{4}-\d{2}-\d{2})T")


@dataclass(frozen=True, slots=True)
class SeasonLog:
    """A log of a campaign.

    Attributes:
        entry: where it is.
        hill: its name.
        orienting: what orients its cameras.
        outcome: what came of it before, however long ago; None if it was never measured.
    """

    entry: Entry
    hill: str
    orienting: Orienting
    outcome: Outcome | None

    @property
    def url(self) -> str:
        """Path or address."""
        return self.entry.url

    @property
    def is_settled(self) -> bool:
        """Whether its outcome is up to date: neither the log nor the way of measuring has changed since."""
        found = self.outcome
        return found is not None and (found.recipe, found.stamp) == (self.orienting.recipe, self.entry.stamp)


def find_logs(campaign: Campaign) -> list[SeasonLog]:
    """The logs of a campaign, hill by hill, with what came of them before.

    Raises:
        BadInputError: a place has none, a log belongs to two hills, a survey is wrong, or a store does not answer.
    """
    hills: dict[str, tuple[Entry, Hill]] = {}
    for hill in campaign.hills:
        for place in hill.logs:
            for entry in filter(_is_first, listed(place, campaign.store)):
                before = hills.setdefault(entry.url, (entry, hill))[1]
                if before.name != hill.name:
                    raise BadInputError(
                        f"{entry.url}: belongs to {before.name} and to {hill.name}; correct their logs in the campaign"
                    )
    read: dict[Source, Orienting] = {}
    sources = {url: _source(url, hill) for url, (_, hill) in hills.items()}
    for source in sources.values():
        if source not in read:
            read[source] = read_orienting(source)
    outcomes = read_outcomes(list(hills), campaign.store)
    return [
        SeasonLog(entry, hill.name, read[sources[url]], decoded(content))
        for (url, (entry, hill)), content in zip(hills.items(), outcomes, strict=True)
    ]


def _is_first(entry: Entry) -> bool:
    """Whether a log is no later part of a split recording, which is measured with the first one."""
    return is_remote(entry.url) or parts_of(path := Path(entry.url))[0] == path


def with_outcomes(logs: Sequence[SeasonLog], outcomes: Mapping[str, Outcome]) -> list[SeasonLog]:
    """The logs with their newest outcomes, by address; an outcome that is out of date is left out."""
    return [replace(log, outcome=outcomes.get(log.url, log.outcome if log.is_settled else None)) for log in logs]


def day_of(url: str) -> date | None:
    """The day on which a log was recorded, UTC, by its name; None if that does not say so."""
    found = _DAY.match(url.rsplit("/", 1)[-1])
    try:
        return None if found is None else date.fromisoformat(found[1])
    except ValueError:
        return None


def _source(url: str, hill: Hill) -> Source:
    """What orients the cameras of a log.

    Raises:
        BadInputError: the hill has surveys by day, and the log's name does not say its day.
    """
    if hill.days:
        day = day_of(url)
        if day is None:
            raise BadInputError(
                f"{url}: its name does not begin with its day, as in 2026-11-21T19-40-18Z.mcap, and the surveys of "
                f"{hill.name} differ by day: rename it, or give it a hill of its own in the campaign"
            )
        for days in hill.days:
            if days.first <= day <= days.last:
                return Source(survey=days.survey, calibration=days.calibration)
    return Source(survey=hill.survey, calibration=hill.calibration)
