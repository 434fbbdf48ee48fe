"""Counts the house: modules, their lines, and the imports between and inside rooms.

`python -m bench.house [CHECKOUT]` prints one JSON object; run it on two checkouts to compare them. Product code is all
Python and JavaScript outside `tests/`, `docs/` and `bench/`.
"""

import ast
import json
import statistics
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_APART = {"tests", "docs", "bench", "config", "systemd"}
_SMALL_LINES = 45


def count(checkout: Path) -> dict[str, Any]:
    """Everything that is counted of a checkout."""
    names = subprocess.run(
        ["git", "-C", str(checkout), "ls-files", "*.py", "*.js", "*.c", "*.h"],  # noqa: S607
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    files = {name: (checkout / name).read_text(encoding="utf-8") for name in names if (checkout / name).exists()}
    product = {name: text for name, text in files.items() if Path(name).parts[0] not in _APART}
    lines = {name: len(text.splitlines()) for name, text in product.items()}
    modules = sorted(lines[name] for name in product if name.endswith(".py") and not name.endswith("__init__.py"))
    edges = [(source, target) for source, text in product.items() for target in set(_imports(source, text, product))]
    folders = Counter(str(Path(name).parent) for name in product if not name.endswith("__init__.py"))
    return {
        "modules": len(modules),
        "median lines": statistics.median(modules),
        "90 % under": modules[int(0.9 * len(modules))],
        f"modules of {_SMALL_LINES} lines or fewer": sum(length <= _SMALL_LINES for length in modules),
        "lines of Python": sum(count for name, count in lines.items() if name.endswith(".py")),
        "lines of JavaScript": sum(count for name, count in lines.items() if name.endswith(".js")),
        "lines of C": sum(count for name, count in lines.items() if name.endswith((".c", ".h"))),
        "imports between rooms": sum(Path(a).parts[0] != Path(b).parts[0] for a, b in edges),
        "imports inside recorder": _inside(edges, "recorder"),
        "imports inside adjustment": _inside(edges, "photogrammetry/adjustment"),
        "folders with more than a dozen modules": {place: n for place, n in sorted(folders.items()) if n > 12},
        "lines by room": dict(Counter[str](_by_room(lines))),
    }


def _by_room(lines: dict[str, int]) -> Counter[str]:
    rooms: Counter[str] = Counter()
    for name, length in lines.items():
        rooms[Path(name).parts[0]] += length
    return rooms


def _inside(edges: list[tuple[str, str]], room: str) -> dict[str, int]:
    """Imports among the modules of a room, and how many of them lead from one of its folders to another."""
    inside = [(a, b) for a, b in edges if a.startswith(room + "/") and b.startswith(room + "/")]
    across = sum(Path(a).parent != Path(b).parent for a, b in inside)
    return {"among its modules": len(inside), "from folder to folder": across}


def _imports(source: str, text: str, product: dict[str, str]) -> Iterator[str]:
    """Files of the product that a Python file imports."""
    if not source.endswith(".py"):
        return
    for node in ast.walk(ast.parse(text)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            path = name.replace(".", "/") + ".py"
            if path in product and path != source:
                yield path


if __name__ == "__main__":
    print(json.dumps(count(Path(sys.argv[1] if len(sys.argv) > 1 else ".")), indent=2))
