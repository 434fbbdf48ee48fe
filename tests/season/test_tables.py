"""The tables of a season, as pandas and polars read them too, and what is asked of them."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb
import pandas as pd
import pytest

from recorder.log.session_changes import write_session_changes
from rig.errors import BadInputError
from season.rows import tables
from season.running.logs import find_logs
from season.tables.comparison import groups
from season.tables.database import DATABASE, asked, build, opened
from season.tables.questions import QUESTIONS
from svev.commands.jumps.season_tables import aligned, group_rows
from tests.season.drawn import Drawn, draw_season
from tests.support.commands import run_svev

DOCS = Path(__file__).parents[2] / "docs" / "how-to" / "season.md"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Drawn:
    season = draw_season(tmp_path_factory.mktemp("drawn"), jumps=240, years=3)
    season.campaign.out.mkdir()
    assert build(season.campaign, find_logs(season.campaign))
    return season


def test_pandas_polars_and_duckdb_read_the_same(drawn: Drawn) -> None:
    for table, rows in (("jumps", 240), ("pulses", 480), ("cameras", 720), ("logs", 240)):
        path = drawn.campaign.out / f"{table}.parquet"
        panda = pd.read_parquet(path)
        # Polars keeps threads and descriptors for as long as the process lives: it gets one of its own.
        with duckdb.connect() as database:
            relation = database.read_parquet(str(path))
            assert (relation.shape, relation.columns) == (panda.shape, list(panda.columns))
        program = f"import json, polars; t = polars.read_parquet({str(path)!r}); print(json.dumps([len(t), t.columns]))"
        polar = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=60, check=True).stdout
        assert [len(panda), list(panda.columns)] == json.loads(polar)
        assert len(panda) == rows
    with opened(drawn.campaign.out) as database:
        (alpha,) = asked(database, "SELECT avg(alpha_at_10_m_deg) FROM jumps")[1][0]
    jumps = pd.read_parquet(drawn.campaign.out / "jumps.parquet")
    assert jumps["alpha_at_10_m_deg"].mean() == pytest.approx(alpha)
    assert set(jumps["season"]) == {"2024/25", "2025/26", "2026/27"}
    assert str(jumps["time_utc"].dtype).startswith("datetime64")


def test_every_column_is_documented() -> None:
    text = DOCS.read_text(encoding="utf-8")
    for table in tables():
        for column in table.columns:
            plain = column
            for name in ("P1", "P2", "P3", "P4"):
                plain = plain.replace(name, "P1")
            for axis in "YZ":
                plain = plain.replace(f"_{axis}_", "_X_")
            assert f"`{column}`" in text or f"`{plain}`" in text or "_at_" in column or table.name == "pulses", column


def test_the_tables_are_made_again_only_when_something_has_changed(drawn: Drawn) -> None:
    logs = find_logs(drawn.campaign)
    before = pd.read_parquet(drawn.campaign.out / "jumps.parquet")
    assert not build(drawn.campaign, logs)
    (drawn.campaign.out / DATABASE).unlink()
    assert build(drawn.campaign, logs)
    pd.testing.assert_frame_equal(pd.read_parquet(drawn.campaign.out / "jumps.parquet"), before)
    assert not list(drawn.campaign.out.glob(".tables-*"))


def test_a_corrected_name_counts_and_a_copied_log_does_not(tmp_path: Path) -> None:
    season = draw_season(tmp_path, jumps=4)
    season.campaign.out.mkdir()
    one = sorted((tmp_path / "hill").glob("*.mcap"))[0]
    write_session_changes(one, {"athlete": "Anna Ny", "gate": ""})
    copy = one.with_name("2030-01-01T10-00-00Z.mcap")
    shutil.copy2(one, copy)
    shutil.copytree(one.with_suffix(".season"), copy.with_suffix(".season"))
    build(season.campaign, find_logs(season.campaign))
    with opened(season.campaign.out) as database:
        assert asked(database, "SELECT count(*) FROM jumps")[1] == [(4,)]
        assert asked(database, "SELECT log FROM logs WHERE copy_of = ?", [str(one)])[1] == [(str(copy),)]
        assert asked(database, "SELECT athlete FROM jumps WHERE log = ?", [str(one)])[1] == [("Anna Ny",)]


def test_the_archive_beside_a_log_counts_once(tmp_path: Path) -> None:
    """Another file with another key, of which the same values came."""
    season = draw_season(tmp_path, jumps=4)
    season.campaign.out.mkdir()
    one = sorted((tmp_path / "hill").glob("*.mcap"))[1]
    archive = one.with_name(f"{one.stem}.compact.mcap")
    shutil.copy2(one, archive)
    shutil.copytree(one.with_suffix(".season"), archive.with_suffix(".season"))
    (key,) = (log.outcome.key for log in find_logs(season.campaign) if log.url == str(one) and log.outcome)
    for file in archive.with_suffix(".season").iterdir():
        file.write_bytes(file.read_bytes().replace(key.encode(), key[::-1].encode()))
    build(season.campaign, find_logs(season.campaign))
    with opened(season.campaign.out) as database:
        assert asked(database, "SELECT log, copy_of FROM logs WHERE copy_of IS NOT NULL")[1] == [
            (str(archive), str(one))
        ]
        assert asked(database, "SELECT count(*) FROM jumps")[1] == [(4,)]
        assert asked(database, "SELECT count(DISTINCT key) FROM pulses")[1] == [(4,)]


def test_a_statement_cannot_change_or_read_anything_else(drawn: Drawn, tmp_path: Path) -> None:
    with opened(drawn.campaign.out) as database:
        for statement in (
            "DROP TABLE jumps", f"COPY jumps TO '{tmp_path / 'x.csv'}'", "SELECT * FROM read_text('/etc/hostname')",
            "SET enable_external_access = true",
        ):  # fmt: skip
            with pytest.raises(BadInputError, match="can only read the tables of the season"):
                asked(database, statement)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("statement", "what_to_do"),
    [
        ("nonsense", "write one statement of DuckDB's SQL"),
        ("SELECT alpha FROM jumps", "DESCRIBE jumps"),
        ("SELECT * FROM flights", "SHOW TABLES"),
    ],
)
def test_a_wrong_statement_is_said_to_be_with_what_to_do(drawn: Drawn, statement: str, what_to_do: str) -> None:
    with opened(drawn.campaign.out) as database, pytest.raises(BadInputError, match=what_to_do):
        asked(database, statement)


@pytest.mark.parametrize("name", QUESTIONS)
def test_ready_questions_have_answers(drawn: Drawn, name: str) -> None:
    with opened(drawn.campaign.out) as database:
        columns, rows = asked(database, QUESTIONS[name].sql)
    assert columns
    assert rows or name == "failed"


def test_athletes_that_differ_are_marked(drawn: Drawn) -> None:
    with opened(drawn.campaign.out) as database:
        found = groups(database, "alpha", 10)
        equal = groups(database, "phi", 10, ["athlete", "hill", "gate", "season"])
    assert sum(group.jumps for group in found) > 200
    middle = sum(drawn.effects.values()) / len(drawn.effects)
    for group in found:
        assert group.difference is not None
        assert group.sigma_difference is not None
        athlete = group.of["athlete"]
        assert athlete is not None
        truth = (drawn.effects[athlete] - middle) * 8 / 7
        assert abs(group.difference - truth) < 4 * group.sigma_difference, athlete
    assert any(group.differs for group in found)
    assert not any(group.differs for group in equal)  # nobody differs in phi, whatever hill, gate and season
    lines = aligned(*group_rows(found))
    assert lines[0].split()[:3] == ["athlete", "jumps", "mean"]
    assert any(line.endswith("*") for line in lines)


def test_the_command_answers(drawn: Drawn) -> None:
    command = ("season", "query", "--in", str(drawn.file))
    asked = "SELECT hill, count(*) AS n, max(day) AS last FROM jumps GROUP BY ALL ORDER BY ALL"
    done = run_svev(*command, asked, "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["columns"] == ["hill", "n", "last"]
    assert [row[:2] for row in answer["rows"]] == [["Hill", 120], ["Other", 120]]
    neither = run_svev(*command)
    assert neither.returncode == 2
    assert "give either SQL or --ask" in neither.stderr
