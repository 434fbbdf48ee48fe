"""The page's sources: types, words in both languages, shapes as the API has them, nothing from outside."""

import ast
import dataclasses
import re
import shutil
import subprocess
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from rig.api import (
    athletes,
    calibrating,
    comparison,
    digitizing,
    jump,
    measuring,
    recordings,
    rehearsal,
    start_list,
    statement,
    status,
)
from rig.api.cameras import aids, balls, light

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "webpanel" / "page"
NPM = ROOT / "tests" / "browser" / "npm"
MODULES = sorted(PAGE.rglob("*.js"))
EVERYTHING = sorted(path for path in PAGE.rglob("*") if path.is_file())
WORDS = re.compile(r'^  "([\w.]+)": "(.*)",$', re.MULTILINE)
#: Keys that are put together in the code, by their beginnings.
COMPOSED = (
    "state.",
    "actions.wait_",
    "camera.",
    "status.",
    "field.",
    "doctor.",
    "rehearsal.",
    "pulses.",
    "list.",
    "export.",
    "log.is_",
    "log.of_",
    "measurement.after_",
    "measurement.state_",
    "measurement.step_",
    "curves.",
    "measured.",
    "spans.q_",
    "calibrating.",
)
#: Ends of the names of the modules that hold words: "", "-check" and so on.
PARTS = sorted(path.stem.removeprefix("en") for path in (PAGE / "i18n").glob("en*.js"))
#: Dialogs that belong to a view.
DIALOGS = {"list-preview": "live", "kinogram-large": "recording"}
#: The rooms whose sentences reach the page.
SPEAKING = ("rig", "photogrammetry", "capture", "triggering", "recorder", "analysis", "service", "webpanel", "svev")
#: Which argument of these calls is the code; the templates follow it.
SAYING = {"phrase": 0, "passed": 1, "warning": 1, "failure": 1}


def _words(language: str) -> dict[str, str]:
    return {
        key: text for part in PARTS for key, text in WORDS.findall((PAGE / "i18n" / f"{language}{part}.js").read_text())
    }


def _placeholders(text: str) -> set[str]:
    return set(re.findall(r"\{(\w+)\}", text))


def _sources() -> str:
    own_words = {PAGE / "i18n" / f"{language}{part}.js" for language in ("en", "nb") for part in PARTS}
    return "\n".join(path.read_text() for path in [*sorted(PAGE.glob("*.html")), *MODULES] if path not in own_words)


def test_the_types_of_the_modules_fit_together() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the types of the page cannot be checked")
    compiler = NPM / "node_modules" / "typescript" / "lib" / "tsc.js"
    if not compiler.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {NPM}, or `make test`")
    command = [node, str(compiler), "-p", str(NPM / "tsconfig.json")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout


def test_both_languages_have_the_same_keys_and_fill_in_the_same() -> None:
    english, norwegian = _words("en"), _words("nb")
    assert list(english) == list(norwegian)
    assert len(english) > 150
    for key, text in english.items():
        assert _placeholders(text) == _placeholders(norwegian[key]), key


def test_every_key_that_is_used_has_words_and_the_other_way_round() -> None:
    english, sources = _words("en"), _sources()
    used = set(re.findall(r'data-t(?:-label|-placeholder)?="([^"]+)"', sources))
    used |= {literal for literal in re.findall(r'"([a-z]+(?:\.[\w]+)*)"', sources) if literal in english}
    called = set(re.findall(r'\bt\("([^"]+)"', sources))
    assert used | called <= set(english)
    assert {key for key in english if not key.startswith(COMPOSED)} <= used | called


def _loaded_with(entry: Path) -> set[Path]:
    """All modules that come with one."""
    loaded, found = set[Path](), {entry}
    while found:
        loaded |= found
        found = set[Path]().union(*map(_imported, found)) - loaded
    return loaded


def _words_used(sources: str) -> set[str]:
    """Keys that are written out or put together in sources."""
    english = set(_words("en"))
    used = set(re.findall(r'data-t(?:-label|-placeholder)?="([^"]+)"', sources))
    used |= set(re.findall(r'"([a-z_]+(?:\.\w+)*)"', sources)) & english
    begun = tuple(re.findall(r"`([a-z]+\.(?:[a-z_]+)?)\$\{", sources))
    return used | {key for key in english if begun and key.startswith(begun)}


def _words_of(*parts: str) -> set[str]:
    names = [f"en-{part}.js" if part else "en.js" for part in parts]
    return {key for name in names for key, _ in WORDS.findall((PAGE / "i18n" / name).read_text())}


def _parts() -> list[tuple[list[str], Path, list[str]]]:
    """Views, entry and sets of words of the parts of the page."""
    table = PAGE / "parts" / "parts.js"
    row = r'views: \[(.*?)\], module: \(\) => import\("\./(.*?)"\), words: \[(.*?)\],'
    return [
        (re.findall(r'"(\w+)"', views), table.with_name(entry), re.findall(r'"(\w+)"', words))
        for views, entry, words in re.findall(row, table.read_text())
    ]


def test_each_part_of_the_page_loads_the_words_that_it_uses() -> None:
    document = (PAGE / "index.html").read_text()
    inner = {
        found[2]: found[0]
        for found in re.finditer(
            r'^ *<(section class="view"|dialog)[^>]*? id="([\w-]+)".*?^  (?:  )?</(?:section|dialog)>',
            document,
            re.MULTILINE | re.DOTALL,
        )
    }
    parts = _parts()
    around = set(inner) - {view for views, _, _ in parts for view in views} - set(DIALOGS)
    assert around == {"loading", "settings", "confirm", "login"}
    frame = _loaded_with(PAGE / "main.js")
    for name in set(inner) - around:
        document = document.replace(inner[name], "")
    said = "\n".join([document, *(module.read_text() for module in frame)])
    assert _words_used(said) <= _words_of("")
    assert len(parts) == 10
    for views, entry, words in parts:
        shown = [inner[name] for name in (*views, *(dialog for dialog, view in DIALOGS.items() if view in views))]
        said = "\n".join([*shown, *(module.read_text() for module in _loaded_with(entry) - frame)])
        assert _words_used(said) <= _words_of("", *words), entry.name


def test_the_page_of_measuring_by_hand_loads_the_words_that_it_uses() -> None:
    entry = PAGE / "digitize" / "main.js"
    found = re.search(r"startLanguage\((.*)\);", entry.read_text())
    assert found
    said = [(PAGE / "digitize.html").read_text(), *(module.read_text() for module in _loaded_with(entry))]
    assert _words_used("\n".join(said)) <= _words_of("", *re.findall(r'"(\w+)"', found[1]))


def _translated() -> dict[str, str]:
    """Norwegian text and advice by code."""
    found: list[tuple[str, str]] = []
    for path in sorted((PAGE / "i18n").glob("nb-*.js")):
        found += re.findall(r"^  (\w+): \[(.*)\],$", path.read_text(), re.MULTILINE)
    assert len(found) == len(dict(found))
    return dict(found)


def test_whatever_the_service_states_or_refuses_is_said_in_norwegian_too() -> None:
    translated = _translated()
    stated = set()
    for path in [*(ROOT / "service").rglob("*.py"), *(ROOT / "webpanel").rglob("*.py")]:
        text = path.read_text()
        stated |= set(re.findall(r'\bcode="(\w+)"', text))
        stated |= set(re.findall(r'\bcode=.* else "(\w+)"', text))
        stated |= set(re.findall(r'_working\("(\w+)"', text))
        kinds = ("partly", "none", "overloaded")
        stated |= {f"{code}_{kind}" for code in re.findall(r'_working\("(\w+)"', text) for kind in kinds}
        stated |= set(re.findall(r'_statement\(\s*"(\w+)"', text))
        stated |= set(
            re.findall(r'(?:ProblemError\(|_unauthorized\(|_refuse\(|problem\()\s*(?:[\w.]+, )?"(\w+)"', text)
        )
    verdicts = set(re.findall(r'Level\.\w+, "(\w+)", ', (ROOT / "service" / "recordings" / "verdicts.py").read_text()))
    assert {"complete", "headless", "disk_full"} <= verdicts
    stated |= {f"verdict_{word}" for word in verdicts}
    assert len(stated) > 20
    assert stated <= set(translated)


class _Module:
    """What a module of ours says: codes, the placeholders of their templates, the values given with them."""

    def __init__(self, path: Path) -> None:
        tree = ast.parse(path.read_text())
        self._named: dict[str, list[tuple[int, ast.expr]]] = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign):
                self._name(node.targets[0], node.value)
            elif isinstance(node, ast.AnnAssign) and node.value is not None:
                self._name(node.target, node.value)
        self.calls = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in SAYING
        ]

    def _name(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for each, its in zip(target.elts, value.elts, strict=False):
                self._name(each, its)
        elif isinstance(target, ast.Name):
            self._named.setdefault(target.id, []).append((target.lineno, value))

    def said(self, call: ast.Call) -> tuple[str, set[str], set[str]]:
        """Code, placeholders in English, names of the values."""
        at = SAYING[ast.unparse(call.func)]
        code = call.args[at]
        assert isinstance(code, ast.Constant), f"the code is not written out: {ast.unparse(call)}"
        templates = "".join(self._text(argument, call.lineno) for argument in call.args[at + 1 :])
        return str(code.value), _placeholders(templates), {keyword.arg or "**" for keyword in call.keywords}

    def _text(self, node: ast.expr, line: int) -> str:
        """A template: written out, put together, or by the name that it was last given above this line."""
        match node:
            case ast.Constant(value=str(text)):
                return re.sub(r"(\{\w+):[^}]*\}", r"\1}", text)
            case ast.BinOp(left=left, right=right):
                return self._text(left, line) + self._text(right, line)
            case ast.BoolOp(values=values):
                return "".join(self._text(value, line) for value in values)
            case ast.Name(id=name) if name in self._named:
                above = [(at, value) for at, value in self._named[name] if at <= line] or self._named[name]
                return self._text(max(above, key=lambda each: each[0])[1], line)
        raise AssertionError(f"line {line}: this template cannot be read: {ast.unparse(node)}")


def test_findings_events_and_reasons_are_said_in_norwegian_too_with_the_values_that_they_have() -> None:
    translated, heard = _translated(), set()
    modules = [path for room in SPEAKING for path in sorted((ROOT / room).rglob("*.py"))]
    for path in modules:
        if path.name in {"phrase.py", "finding.py"} or not re.search(rf"\b({'|'.join(SAYING)})\(", path.read_text()):
            continue
        module = _Module(path)
        for call in module.calls:
            code, english, values = module.said(call)
            where = f"{path.relative_to(ROOT)}:{call.lineno}: {code}"
            assert code in translated, f"{where}: has no Norwegian text"
            assert english <= values, f"{where}: {english - values} is not given"
            assert _placeholders(translated[code]) <= values, f"{where}: {_placeholders(translated[code]) - values}"
            heard.add(code)
    assert len(heard) > 150
    listed = [
        _listed(name)
        for name in (
            "nb-findings.js",
            "nb-events.js",
            "nb-analysis.js",
            "nb-refusals.js",
            "nb-digitizing.js",
            "nb-targets.js",
            "nb-files.js",
            "nb-adjustment.js",
        )
    ]
    assert set().union(*listed) == heard


def test_what_the_state_forbids_is_a_sentence_that_the_page_can_translate() -> None:
    """The kind of refusal alone would only say in Norwegian that it is not possible now."""
    plain = []
    for path in (ROOT / "service").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "StateForbidsError":
                plain += [(path.name, node.lineno)] * isinstance(node.args[0], ast.Constant | ast.JoinedStr)
    assert not plain


def _listed(name: str) -> set[str]:
    return set(re.findall(r"^  (\w+): \[", (PAGE / "i18n" / name).read_text(), re.MULTILINE))


def _types() -> dict[str, list[str]]:
    """Properties by name of the typedef."""
    types: dict[str, list[str]] = {}
    name = ""
    for line in "".join(
        (PAGE / room / "types.js").read_text() for room in ("shared", "system", "recordings", "athletes", "digitize")
    ).splitlines():
        if found := re.search(r"@typedef \{object\} (\w+)", line):
            name = found[1]
            types[name] = []
        elif found := re.search(r"@property \{.*\} (\w+)", line):
            types[name].append(found[1])
    return types


@pytest.mark.parametrize("name", sorted(_types()))
def test_the_shapes_are_those_of_the_api(name: str) -> None:
    rooms = (
        digitizing,
        athletes,
        calibrating,
        comparison,
        aids,
        balls,
        light,
        start_list,
        recordings,
        rehearsal,
        statement,
        jump,
        measuring,
        status,
    )
    model: type[Any] = next(getattr(room, name) for room in rooms if hasattr(room, name))
    fields = (
        list(model.model_fields) if issubclass(model, BaseModel) else [each.name for each in dataclasses.fields(model)]
    )
    assert _types()[name] == fields


def _imported(module: Path) -> set[Path]:
    """The modules that a module cannot do without."""
    found = re.findall(r'^(?:import|export) .* from "(.+)";$', module.read_text(), re.MULTILINE)
    return {(module.parent / target).resolve() for target in found}


def _imported_later(module: Path) -> set[Path]:
    """The modules that it loads while it runs, if their names are written out."""
    return {(module.parent / target).resolve() for target in re.findall(r'=> import\("(.+?)"\)', module.read_text())}


def test_modules_import_each_other_one_way() -> None:
    """Views see what is shared, never each other; only `parts`, what is behind each view, sees several."""
    hand = ("session", "marking", "views", "cards")  # of measuring by hand, each sees those before it
    views = ("athletes", "jump", "live", "recordings", "system", "viewing")
    sees = {
        "": {"frame", "i18n", "parts", "shared"},
        "parts": {*views, "parts", "i18n", "shared"},
        "digitize": {*(f"digitize/{room}" for room in hand), "digitize", "frame", "i18n", "shared"},
        **{
            f"digitize/{room}": {*(f"digitize/{seen}" for seen in hand[: k + 1]), "i18n", "shared"}
            for k, room in enumerate(hand)
        },
        "frame": {"frame", "i18n", "shared"},
        **{view: {view, "i18n", "shared"} for view in views},
        "recordings": {"recordings", "viewing", "i18n", "shared"},
        "shared": {"i18n", "shared"},
        "i18n": {"i18n", "shared"},
    }
    imports: dict[str, set[str]] = {}
    for module in MODULES:
        name = module.relative_to(PAGE).as_posix()
        imports[name] = {target.relative_to(PAGE).as_posix() for target in _imported(module) | _imported_later(module)}
        assert {target.rpartition("/")[0] for target in imports[name]} <= sees[name.rpartition("/")[0]], name
    tuple(TopologicalSorter(imports).static_order())  # raises CycleError


@pytest.mark.parametrize("path", EVERYTHING, ids=lambda path: path.name)
def test_nothing_comes_from_outside_and_nothing_is_inline(path: Path) -> None:
    text = path.read_text()
    assert not re.sub(r"http://www\.w3\.org/2000/svg", "", text).count("://")
    assert not re.search(r"url\(|@import", text) or path.suffix == ".js"
    if path.suffix == ".html":
        assert not re.search(r'\sstyle="|\son\w+="|<style|javascript:', text)
        assert all("src=" in tag for tag in re.findall(r"<script[^>]*>", text))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_modules_are_short(path: Path) -> None:
    limit = 400 if path.parent.name == "i18n" else 250
    assert len(path.read_text().splitlines()) <= limit


def test_icons_that_are_shown_exist() -> None:
    drawn = set(re.findall(r'<symbol id="([\w-]+)"', (PAGE / "icons.svg").read_text()))
    shown = set(re.findall(r"icons\.svg#([\w-]+)", _sources()))
    shown |= set(re.findall(r'\bicon(?:\(|: )"([\w-]+)"', _sources()))
    shown |= {state.value for state in status.State} - {"disarming"} | {level.value for level in statement.Level}
    assert shown <= drawn
