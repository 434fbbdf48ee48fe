"""All measured jumps under the names of those who jumped, in the form of the REST API."""

import unicodedata
from datetime import datetime

from pydantic import AwareDatetime, Field

from rig.api.fields import Line, Model, WholeNumber
from rig.api.jump import LastJump
from rig.api.statement import Level


class AthleteJump(Model):
    """One measured jump, with whose it is."""

    athlete: str = Field("", description="as the recording has it at present")
    bib: str = ""
    gate: str = ""
    level: Level = Field(description="`good`, `warning`: not measured well, `info`: only measured live so far")
    jump: LastJump


class Athlete(Model):
    """Somebody of whom jumps were measured."""

    name: str = Field(description="as the latest of the jumps has it")
    bib: str = Field("", description="of that jump")
    jumps: int
    first: datetime
    last: datetime


class JumpQuery(Model):
    """Which measured jumps are wanted, newest first; those that fit everything that is given."""

    athlete: Line = ""
    search: Line = ""
    since: AwareDatetime | None = None
    until: AwareDatetime | None = None
    limit: WholeNumber | None = None


def folded(name: str) -> str:
    """What two spellings of one name have in common: neither case nor spaces make another athlete of somebody."""
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())
