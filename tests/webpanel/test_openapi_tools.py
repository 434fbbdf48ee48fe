"""The description of the API by the tools of others: it is valid, and a client made from it has every operation."""

import json
import subprocess
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import serving
from webpanel.door.access import Access

validator = pytest.importorskip("openapi_spec_validator", reason="openapi-spec-validator is not installed: make setup")
#: In an environment of its own: it wants an older typer than Svev.
_CLIENT_TOOL = Path(__file__).parents[2] / "build" / "client-tool" / "bin" / "openapi-python-client"


@pytest.fixture
def schema(client: httpx.Client) -> dict[str, Any]:
    found: dict[str, Any] = client.get("/openapi.json").json()
    return found


def _errors(schema: dict[str, Any]) -> list[str]:
    return [error.message for error in validator.OpenAPIV31SpecValidator(schema).iter_errors()]


def test_the_description_is_valid_with_tokens_and_without(
    schema: dict[str, Any], service: MemoryService, loopback: Loopback
) -> None:
    assert _errors(schema) == []
    assert set(schema["components"]["securitySchemes"]) == {"token", "session"}
    assert not [name for name in schema["components"]["schemas"] if "__" in name], "two models have one name"
    token = "a-token-for-the-tests-only"  # noqa: S105
    access = Access.for_address(loopback.host, environment={"SVEV_TOKEN": token})
    with serving(service, access) as panel, panel.client(headers={"Authorization": f"Bearer {token}"}) as client:
        assert _errors(client.get("/openapi.json").json()) == []


@pytest.mark.skipif(not _CLIENT_TOOL.exists(), reason="openapi-python-client is not there: make client-tool")
def test_a_client_made_from_it_has_every_operation(schema: dict[str, Any], tmp_path: Path) -> None:
    described, made = tmp_path / "openapi.json", tmp_path / "client"
    described.write_text(json.dumps(schema))
    command = [str(_CLIENT_TOOL), "generate", "--path", str(described), "--output-path", str(made), "--meta", "none"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
    assert "Endpoint will not be generated" not in done.stdout, done.stdout
    there = {path.stem for path in made.glob("api/*/*.py")} - {"__init__"}
    assert there == {operation["operationId"] for path in schema["paths"].values() for operation in path.values()}
    models = [path.read_text() for path in made.glob("models/*.py")]
    assert models
    for source in models:
        compile(source, "model", "exec")
