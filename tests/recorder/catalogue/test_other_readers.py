"""The catalogue in programs of others, as the docs say: DuckDB by its SQLite extension, and pandas without it."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from recorder.catalogue.folder import Catalogue
from recorder.log.session_changes import write_session_changes
from tests.recorder.catalogue.test_search import Judge
from tests.recorder.logs import ALL_OK, write_log

_ROOT = Path(__file__).parents[3]
#: DuckDB with an extension that needs no network (`make readers`), beside the one of Svev's environment.
_READERS = _ROOT / "build" / "readers"
_DOCS = _ROOT / "docs" / "how-to" / "export.md"
_ANSWER = [["anna berg", 49.0]]


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """Recordings, and a service that has their catalogue open."""
    (tmp_path / "recordings").mkdir()
    for name, athlete in (("a-47-49", "Anna Berg"), ("b-48", "Bjørn Lie")):
        write_log(tmp_path / "recordings" / f"{name}.mcap", (ALL_OK,))
        write_session_changes(tmp_path / "recordings" / f"{name}.mcap", {"athlete": athlete})
    with closing(Catalogue(tmp_path / "recordings", Judge())) as found:
        found.entries()
        yield tmp_path


def _documented(language: str) -> str:
    """The example of the docs in a language."""
    found = re.search(rf"```{language}\n(.*?\.svev-catalogue\.db.*?)```", _DOCS.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def _run(program: str, folder: Path, **environment: str) -> object:
    command = [sys.executable, "-c", program]
    environ = {**os.environ, **environment}
    done = subprocess.run(command, cwd=folder, env=environ, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.skipif(not _READERS.exists(), reason="programs of others are missing: run make readers")
def test_duckdb_reads_it(folder: Path) -> None:
    (extension,) = _READERS.glob("duckdb_extension_sqlite_scanner/extensions/*/sqlite_scanner.duckdb_extension")
    statements = _documented("sql").replace("INSTALL sqlite;", "").replace("LOAD sqlite;", f"LOAD '{extension}';")
    program = f"import duckdb, json\nfound = duckdb.sql({statements!r})\nprint(json.dumps(found.fetchall()))"
    assert _run(program, folder, PYTHONPATH=str(_READERS)) == _ANSWER


def test_pandas_and_duckdb_read_it_without_an_extension(folder: Path) -> None:
    program = f"{_documented('python')}\nimport json\nprint(json.dumps(jumps.values.tolist()))"
    assert _run(program, folder) == _ANSWER
