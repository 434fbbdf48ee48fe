"""The table of faults in `docs/explanation/reliability.md`: tests of faults fill it in, and check it.

A test that brings a fault about tells what came of it. Normally the row of that fault in the document must say the
same; with `--write-reliability` the rows of the document are written anew from what the tests tell.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "explanation" / "reliability.md"
_BEGIN: Final = "<!-- table of faults: written by pytest --write-reliability, do not edit -->"
_END: Final = "<!-- end of the table of faults -->"
_HEAD: Final = "| fault | pulses lost | what is said | exit code |\n|---|---|---|---|\n"
_PROPERTY: Final = "fault"
_rows = pytest.StashKey[list["Row"]]()


@dataclass(frozen=True, slots=True)
class Row:
    """What came of a fault.

    Attributes:
        room: heading under which the fault stands.
        fault: what was done.
        lost: pulses or frames that are missing in the log, in words.
        said: what a person is told.
        code: exit code, or "-" where nothing ends.
    """

    room: str
    fault: str
    lost: str
    said: str
    code: str

    @property
    def constant(self) -> tuple[str, str]:
        """What must be the same at every run: the words without numbers and paths, and the exit code."""
        return re.sub(r"\d+(\.\d+)?", "N", self.said), self.code


class FaultTable:
    """Takes what a test has seen; the fixture `fault_table`."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        self._request = request

    def tell(self, room: str, fault: str, *, lost: object, said: str, code: object = "-") -> None:
        """Tell what came of a fault, and compare it with the document; fields as in `Row`."""
        words = re.sub(r"(?<![\w.])/\S*/", "…/", said.removeprefix("svev: ")).replace("|", "/")
        words = " ".join(re.sub(r"\d{4}-\d\d-\d\dT[\d-]+Z", "ID", words).split())
        row = Row(room, fault, str(lost), words, str(code))
        self._request.node.user_properties.append((_PROPERTY, vars_of(row)))
        if self._request.config.getoption("--write-reliability"):
            return
        documented = {(known.room, known.fault): known for known in rows()}.get((room, fault))
        assert documented is not None, f"{DOCUMENT.name} has no row for: {row}; run pytest --write-reliability"
        assert row.constant == documented.constant, f"{DOCUMENT.name} says something else; see --write-reliability"


@pytest.fixture
def fault_table(request: pytest.FixtureRequest) -> FaultTable:
    """The table of faults in the documentation."""
    return FaultTable(request)


def rows(text: str | None = None) -> list[Row]:
    """The rows of the table in the document."""
    table = (text or DOCUMENT.read_text(encoding="utf-8")).partition(_BEGIN)[2].partition(_END)[0]
    found, room = [], ""
    for line in table.splitlines():
        if line.startswith("### "):
            room = line[4:]
        elif line.startswith("| ") and not line.startswith("| fault"):
            found.append(Row(room, *(cell.strip() for cell in line.strip("|").split("|"))))
    return found


def vars_of(row: Row) -> dict[str, str]:
    """The fields of a row."""
    return {name: getattr(row, name) for name in Row.__slots__}


def note(config: pytest.Config, report: pytest.TestReport) -> None:
    """Keep the rows that a passed test has told."""
    if report.when == "call" and report.passed:
        told = [Row(**fields) for name, fields in report.user_properties if name == _PROPERTY]  # type: ignore[arg-type]
        config.stash.setdefault(_rows, []).extend(told)


def write(config: pytest.Config) -> None:
    """Write the told rows into the document: in the place of those of the same fault, or at the end of their room."""
    told = config.stash.get(_rows, [])
    known = {(row.room, row.fault): row for row in rows()}
    known |= {(row.room, row.fault): row for row in told}
    text = DOCUMENT.read_text(encoding="utf-8")
    before, after = text.partition(_BEGIN)[0], text.partition(_END)[2]
    table = "\n".join(_section(room, known.values()) for room in dict.fromkeys(row.room for row in known.values()))
    DOCUMENT.write_text(f"{before}{_BEGIN}\n\n{table}\n{_END}{after}", encoding="utf-8")


def _section(room: str, known: Iterable[Row]) -> str:
    return f"### {room}\n\n{_HEAD}" + "".join(_lines(row for row in known if row.room == room))


def _lines(those: Iterable[Row]) -> Iterator[str]:
    for row in those:
        yield f"| {row.fault} | {row.lost} | {row.said} | {row.code} |\n"
