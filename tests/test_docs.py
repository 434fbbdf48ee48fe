"""The documentation is true: examples run, links lead somewhere, commands exist, messages are those of the code."""

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import typer.main
from _pytest.mark.structures import ParameterSet
from typer.core import TyperGroup

from analysis.scene.orientation import orient_images
from analysis.scene.survey import read_survey
from recorder.publishing.keys import make_keys
from svev import cli
from tests.analysis.scene.hill import training, training_detections, training_images
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.message_index import anchor, index, messages, shown
from tests.support.rigs import write_rig

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
SOURCES = [
    path
    for room in (
        "svev",
        "webpanel",
        "service",
        "season",
        "analysis",
        "recorder",
        "photogrammetry",
        "capture",
        "triggering",
        "simrig",
        "rig",
    )
    for path in (ROOT / room).rglob("*.py")
]
#: Where sentences of docstrings are not counted yet.
UNTIDY = ("analysis/candidates", "analysis/identification", "analysis/ski_bars", "season")
DECISIONS = sorted((ROOT / "docs" / "decisions").glob("0*.md"))
FENCE = re.compile(r"```(\w*)\n(.*?)```", re.DOTALL)
RUN = re.compile(
    r"<!-- run(?: beside svev (?:replay(?P<replay>.*?)|(?P<serve>serve)))?, prints: (?P<prints>.*?) -->\n"
    r"```python\n(?P<code>.*?)```",
    re.DOTALL,
)
#: Commands of later versions that a page may name because it says that they do not exist yet.
LATER = {"serve"}


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text()):
        if target.startswith("https://"):
            continue
        path, _, place = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), target
        if place:
            headings = re.findall(r"^#+ (.*)$", there.read_text(), re.MULTILINE)
            assert place in {anchor(heading) for heading in headings}, target


@pytest.mark.parametrize("drawing", sorted(ROOT.glob("docs/images/*.svg")), ids=_name)
def test_drawings_are_for_light_and_dark_and_fetch_nothing(drawing: Path) -> None:
    text = drawing.read_text()
    root = ET.fromstring(text)  # noqa: S314
    assert root.get("aria-label")
    assert "prefers-color-scheme: dark" in text
    for part in root.iter():
        assert not part.tag.endswith(("script", "image", "use", "foreignObject"))
        assert not [name for name in part.attrib if name.endswith("href") or name == "style"]
    assert any(f"images/{drawing.name})" in page.read_text() for page in PAGES), "no page shows it"


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_commands_and_targets_exist(page: Path) -> None:
    text = re.sub(r"^(### |- \[`).*$", "", page.read_text(), flags=re.MULTILINE)  # headings and index quote messages
    code = " ; ".join([*re.findall(r"`([^`\n]+)`", text), *(body for _, body in FENCE.findall(text))])
    assert set(re.findall(r"(?<![\w/])svev ([a-z]+)", code)) <= set(_command_line().commands) | LATER
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z]+)", code)) <= targets


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_options_in_the_examples_exist(page: Path) -> None:
    for language, body in FENCE.findall(page.read_text()):
        for command, rest in re.findall(r"^svev ([a-z]+)(.*)$", body if language == "sh" else "", re.MULTILINE):
            parameters = _parameters(_command_line(), [command, *rest.split()])
            known = {option for parameter in parameters for option in parameter.opts}
            assert set(re.findall(r"--[a-z-]+", rest)) <= known, f"svev {command}{rest}"


@cache
def _command_line() -> TyperGroup:
    group = typer.main.get_command(cli.command_line())
    assert isinstance(group, TyperGroup)
    return group


def _parameters(command: Any, words: list[str]) -> list[Any]:
    """Parameters of a command and of those below it that are named."""
    found = list(command.params)
    if isinstance(command, TyperGroup) and words and words[0] in command.commands:
        found += _parameters(command.commands[words[0]], words[1:])
    return found


def _messages() -> list[str]:
    """Every text in the code, with `…` where something is filled in."""
    found = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                found.append("".join(str(p.value) if isinstance(p, ast.Constant) else "…" for p in node.values))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return found


def test_troubleshooting_quotes_the_code() -> None:
    said = _messages()
    assert len(messages()) > 200
    for words, _ in messages():
        pieces = [re.escape(piece.strip()) for piece in words.split("…") if piece.strip()]
        pattern = re.compile(".*".join(pieces), re.DOTALL)
        assert any(pattern.search(message) for message in said), words


@pytest.mark.parametrize("page", DECISIONS, ids=_name)
def test_decisions_are_choices_and_indexed_by_their_titles(page: Path) -> None:
    text = page.read_text()
    number, title = text.splitlines()[0].removeprefix("# ").split(": ", 1)
    assert page.name.startswith(number)
    assert re.search(r"^Status: (accepted|superseded)\b", text, re.MULTILINE)
    for part in ("Context", "Decision", "Consequences"):
        assert re.search(rf"^\*\*{part}\.\*\*", text, re.MULTILINE), part
    index = (page.parent / "README.md").read_text()
    assert index.count(f"| [{number}]({page.name}) | {title} |") == 1


def test_every_page_is_on_the_way_from_the_door() -> None:
    known, ahead = set[Path](), [ROOT / "docs" / "index.md"]
    while ahead:
        page = ahead.pop()
        if page in known or page.suffix != ".md":
            continue
        known.add(page)
        links = re.findall(r"\]\(([^)#]+\.md)", page.read_text())
        ahead += [(page.parent / link).resolve() for link in links if not link.startswith("https://")]
    assert set(PAGES) <= known


def test_the_index_of_messages_has_every_heading() -> None:
    assert shown() == index(), "run: python -m tests.support.message_index"


def _overloaded(text: str) -> list[str]:
    """The sentences of a text that have three relative pronouns: a noun says it in fewer words."""
    text = re.sub(r"`[^`]*`|\]\([^)]*\)", "", text)
    paragraphs = re.split(r"\n\s*\n|\n\s*(?:-|\d+\.|\w+:) ", text)
    sentences = [each for paragraph in paragraphs for each in re.split(r"[.:;!?]\s", paragraph)]
    pronoun = re.compile(r"\b(?:which|that|what|who|whose|whom)\b")
    return [" ".join(each.split()) for each in sentences if len(pronoun.findall(each)) > 2]


def test_no_sentence_must_be_read_twice() -> None:
    found = []
    for page in PAGES:
        if page.parent == ROOT:
            continue
        text = re.sub(r"```.*?```|^(?:\||#|<!--|- \[`).*?$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
        found += [f"{_name(page)}: {each}" for each in _overloaded(text)]
    assert not found, "\n".join(found)


def test_no_docstring_or_comment_must_be_read_twice() -> None:
    found = []
    for path in SOURCES:
        if any(path.is_relative_to(ROOT / place) for place in UNTIDY):
            continue
        source = path.read_text()
        nodes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
        texts = [ast.get_docstring(each) or "" for each in ast.walk(ast.parse(source)) if isinstance(each, nodes)]
        comments = re.findall(r"((?:^[ \t]*#.*\n)+)", source, re.MULTILINE)
        texts += [re.sub(r"^[ \t]*#:?", "", each, flags=re.MULTILINE) for each in comments]
        found += [f"{_name(path)}: {each}" for text in texts for each in _overloaded(text)]
    assert not found, "\n".join(found)


def test_the_survey_of_the_page_on_measuring_fits_the_simulated_hill(tmp_path: Path) -> None:
    (example,) = re.findall(r"```json\n(.*?)```", (ROOT / "docs" / "how-to" / "measuring.md").read_text(), re.DOTALL)
    path = tmp_path / "survey.json"
    path.write_text(example)
    scene = orient_images(training_images(), read_survey(path), training_detections())
    for camera in training().cameras:
        assert np.allclose(scene.cameras[camera.name].position, camera.X0, atol=0.2), camera.name
    assert "15 of 15 surveyed balls in sight named" in str(scene.messages[0])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory, loopback: Loopback) -> Path:
    """A recording of the simulated hill, made as the quick start says: one that lacks no frame.

    The pages show a whole one, and a busy machine, whose simulated cameras come too late, loses frames of some.
    """
    for _ in range(10):
        folder = tmp_path_factory.mktemp("docs")
        rig = write_rig(folder, loopback, backend="sim")
        command = f"{sys.executable} -m svev record --rig {rig} --seconds 1 --out {folder} --json".split()
        done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
        result = json.loads(done.stdout)
        if result["complete"] == result["pulses"]:
            return Path(result["log"])
    raise AssertionError(f"ten recordings lack frames: {done.stdout}")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, loopback: Loopback) -> Iterator[Serving]:
    """A service on the simulated hill, armed, with two recordings."""
    folder = tmp_path_factory.mktemp("serve")
    with serving(folder, write_rig(folder, loopback, backend="sim"), loopback) as running:
        running.arm()
        for _ in range(2):
            recording = running.post("/api/recordings", {"athlete": "Kari"})["id"]
            running.await_pulses(5)
            running.post(f"/api/recordings/{recording}/stop")
            running.await_state("armed")
        yield running


@contextmanager
def _replay(log: Path, address: str, *options: str) -> Iterator[None]:
    """Another terminal, in which the log is replayed."""
    command = [sys.executable, "-m", "svev", "replay", str(log), "--bind", address, *options]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield
        finally:
            process.terminate()
            process.communicate(timeout=30)


def _examples(*, serve: bool) -> Iterator[ParameterSet]:
    for page in PAGES:
        for number, match in enumerate(RUN.finditer(page.read_text()), start=1):
            if (match["serve"] is not None) is serve:
                yield pytest.param(match, id=f"{_name(page)}-{number}")


def _run(example: re.Match[str], folder: Path, **given: str) -> None:
    """Run an example, with these names given to it."""
    program = folder / "example.py"
    program.write_text("".join(f"{name} = {value!r}\n" for name, value in given.items()) + example["code"])
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert example["prints"] in done.stdout


@pytest.mark.parametrize("example", list(_examples(serve=False)))
def test_examples_run(example: re.Match[str], log: Path, loopback: Loopback, tmp_path: Path) -> None:
    address = loopback.endpoint()
    with ExitStack() as stack:
        secret, public = make_keys(tmp_path / "hill")
        if example["replay"] is not None:
            options = [str(secret) if word == secret.name else word for word in example["replay"].split()]
            stack.enter_context(_replay(log, address, *options))
        _run(example, tmp_path, LOG=str(log), ADDRESS=address, KEYS=str(public))


@pytest.mark.long
@pytest.mark.parametrize("example", list(_examples(serve=True)))
def test_examples_run_beside_the_service(example: re.Match[str], service: Serving, tmp_path: Path) -> None:
    service.await_state("armed")
    service.await_cameras("ready", "ready", "ready")
    token = "none-is-needed-on-loopback"  # noqa: S105
    _run(example, tmp_path, URL=service.url, FOLDER=str(tmp_path), TOKEN=token)
