"""Pages of the site that do not lie in docs: those at the top of the repository, and references made from the code.

Hooks of mkdocs (https://www.mkdocs.org/user-guide/configuration/#hooks).
"""

import ast
import json
import posixpath
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

_ROOT: Final = Path(__file__).resolve().parents[2]
#: Written by `make docs` from the service's own description.
_OPENAPI: Final = _ROOT / "build" / "docs" / "openapi.json"
#: Pages of the site by files at the top of the repository.
_TOP: Final = {"README.md": "readme.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
_PYTHON: Final = """# Python reference

What a program may use, from the docstrings. How: [in a program](../how-to/programs.md).

::: photogrammetry
    options:
      members: %s
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add pages that do not lie in docs."""
    pages = {page: (_ROOT / name).read_text() for name, page in _TOP.items()}
    pages["reference/rest-calls.md"] = _rest_calls(json.loads(_OPENAPI.read_text()))
    pages["reference/python.md"] = _PYTHON % json.dumps(_public(_ROOT / "photogrammetry" / "__init__.py"))
    for page, text in pages.items():
        files.append(File.generated(config, page, content=text))
    worker = Path(__file__).with_name("worker.js").read_text()
    files.append(File.generated(config, "assets/iframe-worker.js", content=worker))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Turn links of the repository into links of the site; a file that is no page keeps its name alone."""
    here = page.file.src_uri
    source = next((name for name, made in _TOP.items() if made == here), f"docs/{here}")

    def link(found: re.Match[str]) -> str:
        label, target = found.groups()
        if re.match(r"[a-z]+:|#", target):
            return found[0]
        path, mark, anchor = target.partition("#")
        there = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        there = _TOP.get(there, there.removeprefix("docs/") if there.startswith("docs/") else "")
        if not there:
            return label
        return f"[{label}]({posixpath.relpath(there, posixpath.dirname(here) or '.')}{mark}{anchor})"

    return re.sub(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)", link, markdown)


def _public(package: Path) -> list[str]:
    """The names in `__all__` of a package, without importing it."""
    for node in ast.parse(package.read_text()).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return sorted(ast.literal_eval(node.value))
    raise ValueError(f"{package} has no __all__")


def _rest_calls(api: dict[str, Any]) -> str:
    """All calls of the REST API with their parameters and answers, and the types that they name."""
    text = ["# REST calls", "Every call, as the service describes it at `/openapi.json`. In words: [REST](rest.md).\n"]
    for path, calls in api["paths"].items():
        for method, call in calls.items():
            text += [f"## {method.upper()} {path}\n", *_call(call)]
    text.append("## Types\n")
    for name, schema in sorted(api["components"]["schemas"].items()):
        text += [f"### {name}\n", *_named_type(schema)]
    return "\n".join(text)


def _call(call: dict[str, Any]) -> Iterator[str]:
    yield f"{call.get('description') or call.get('summary', '')}\n"
    yield from _table(
        "parameter | in | type | required | meaning",
        (
            (
                f"`{each['name']}`",
                each["in"],
                _type(each["schema"]),
                _yes(each.get("required")),
                each.get("description"),
            )
            for each in call.get("parameters", [])
        ),
    )
    for kind, body in call.get("requestBody", {}).get("content", {}).items():
        yield f"Body: `{kind}`, {_type(body.get('schema', {}))}.\n"
    yield from _table(
        "answer | content | meaning",
        (
            (
                code,
                ", ".join(f"`{kind}` {_type(of.get('schema', {}))}" for kind, of in answer.get("content", {}).items()),
                answer.get("description"),
            )
            for code, answer in call["responses"].items()
        ),
    )


def _named_type(schema: dict[str, Any]) -> Iterator[str]:
    yield f"{schema.get('description', '')}\n"
    if "enum" in schema:
        yield "One of " + ", ".join(f"`{value}`" for value in schema["enum"]) + ".\n"
    yield from _table(
        "field | type | required | meaning",
        (
            (f"`{field}`", _type(of), _yes(field in schema.get("required", [])), of.get("description"))
            for field, of in schema.get("properties", {}).items()
        ),
    )


def _table(head: str, rows: Iterable[Iterable[str | None]]) -> Iterator[str]:
    """A table in Markdown; nothing if it has no rows."""
    lines = [
        "| " + " | ".join(" ".join((cell or "").split()).replace("|", "\\|") for cell in row) + " |" for row in rows
    ]
    if lines:
        yield from (f"| {head} |", "|" + "---|" * len(head.split(" | ")), *lines, "")


def _type(schema: dict[str, Any]) -> str:
    """A schema in a few words, with links to the named types."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(_type(each) for each in choices))
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    return str(
        schema.get("format")
        or schema.get("type")
        or ("`" + str(schema["const"]) + "`" if "const" in schema else "anything")
    )


def _yes(holds: object) -> str:
    return "yes" if holds else ""
