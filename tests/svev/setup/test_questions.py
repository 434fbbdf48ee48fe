"""`svev setup` at a terminal: typed answers, real Aravis with simulated cameras, and a call that is broken off."""

import json
import re
import signal
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.settings.file import CONFIG, load_rig
from simrig.programs.simulated_hill import SimulatedHill
from svev.setup.options_file import ServiceOptions
from tests.analysis.scene.hill import survey_json, training
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.svev.setup.terminal import Terminal
from webpanel.door.access import Access
from webpanel.door.tls import Tls

SCENARIO = CONFIG / "scenarios" / "training.toml"


@pytest.fixture
def cameras(loopback: Loopback) -> Iterator[tuple[str, ...]]:
    """Addresses of three running cameras with pulses, which answer broadcasts."""
    addresses = loopback.cameras(3)
    names = dict(zip(("K1", "K2", "K3"), addresses, strict=True))
    with SimulatedHill(SCENARIO, names, 30.0, broadcast="127.255.255.255"):
        yield addresses


def network(loopback: Loopback) -> tuple[str, str]:
    """Other tests' cameras are left alone."""
    return "--network", f"{loopback.block}.0/24"


def published(folder: Path, loopback: Loopback) -> None:
    """A rig file that has an address of its own for publication, a comment, and cameras that are not there."""
    (folder / "rig.toml").write_text(
        f'# ours\nname = "before"\n[network]\npublish = "{loopback.endpoint()}"  # kept\n[trigger]\nsettle_s = 60.0\n'
        '[[cameras]]\nname = "old"\nbackend = "aravis"\naddress = "192.0.2.7"\n'
    )


@pytest.mark.long
def test_typed_answers_make_a_rig_that_is_rehearsed(
    tmp_path: Path, loopback: Loopback, cameras: tuple[str, ...]
) -> None:
    survey = tmp_path / "balls.json"
    survey.write_text(json.dumps(survey_json(training(), 1)))
    hill = tmp_path / "hill"
    hill.mkdir()
    published(hill, loopback)
    with Terminal("setup", "--folder", str(hill), *network(loopback)) as terminal:
        terminal.answer("English or Norwegian (en or nb)? [en]", "fr")
        terminal.answer("give en (English) or nb (Norwegian)\nEnglish or Norwegian (en or nb)? [en]", "")
        terminal.answer("What is the hill called? [before]", "Granåsen K124")
        said = terminal.await_text("Numbers, e.g. 2 1 3: [1 2 3]")
        page = Path(re.search(r"on this page: (\S+)", said)[1])  # type: ignore[index]
        assert page.read_text().count("<img ") == 3
        assert all((page.parent / f"{number}.png").stat().st_size > 1000 for number in (1, 2, 3))
        terminal.type("1 1\n")
        terminal.answer("each once, 8 at most\n", "3 1 2")
        terminal.answer("Which of them? [external]", "")
        terminal.answer("How many pulses a second? [30]", "30,0")
        terminal.answer("(they have Line0, Line1)? [Line0]", "Line7")
        terminal.answer("the cameras have Line0, Line1; give one of these\n", "Line0")
        terminal.answer("if there is none yet: [none]", str(tmp_path / "missing.json"))
        terminal.answer("no such file", str(survey))
        terminal.answer("Folder for the recordings:", str(tmp_path / "recordings"))
        terminal.answer("Shall phones and other computers reach the page? [no]", "maybe")
        terminal.answer("yes or no, please", "y")
        terminal.answer("call this computer?", "hillpc.local, 192.168.1.20")
        terminal.answer("HTTPS; phones are told once to trust it)? [yes]", "")
        terminal.await_text("Rehearsing")
        code = terminal.end()
        shown = terminal.shown
    rig = load_rig(hill / "rig.toml")
    assert [(each.name, each.address) for each in rig.cameras] == [
        ("K1", cameras[2]), ("K2", cameras[0]), ("K3", cameras[1]),
    ]  # fmt: skip
    assert (rig.name, rig.recorder.directory) == ("Granåsen K124", tmp_path / "recordings")
    assert rig.analysis is not None
    assert rig.analysis.survey == hill / "survey.json"
    text = (hill / "rig.toml").read_text()
    assert "# ours" in text
    assert "  # kept" in text
    # A crowded computer may lose frames in the rehearsal, and then it has to say so.
    assert "  15 surveyed balls, cameras K1, K2, K3" in shown
    assert (code, "ready: " in shown) == (0, True) or (code, "the rehearsal failed: " in shown) == (3, True), shown
    (backup,) = hill.glob("rig.toml.*")
    assert 'name = "before"' in backup.read_text()
    options = ServiceOptions.read(hill / "options")
    access = Access.for_address(options.host, Path(options.values("--token-file")[0]), options.names, {})
    assert access.tokens
    assert access.names >= {"hillpc.local", "192.168.1.20"}
    assert Tls.of(Path(options.values("--tls-certificate")[0]), Path(options.values("--tls-key")[0]))
    assert stat.S_IMODE((hill / "token").stat().st_mode) == 0o640
    assert (hill / "token").read_text().strip() in shown
    assert "sudo " in shown
    assert f"setup --folder /etc/svev --yes --language en --name 'Granåsen K124' --camera K1={cameras[2]}" in shown
    assert not list(hill.glob(".*"))
    assert not page.exists()


def test_with_answers_as_options_nothing_is_asked_and_what_is_not_asked_about_stays(
    tmp_path: Path, loopback: Loopback, cameras: tuple[str, ...]
) -> None:
    published(tmp_path, loopback)
    (tmp_path / "options").write_text("# mine\nSVEV_OPTIONS=--preroll 9 --port 8123\n")
    named = [word for name, address in zip("ABC", cameras, strict=True) for word in ("--camera", f"{name}={address}")]
    asked = (
        *named,
        "--trigger-input",
        "Line0",
        "--phones",
        "--call",
        "hillpc.local",
        "--yes",
        "--no-rehearse",
        "--json",
    )
    first = run_svev("setup", "--folder", str(tmp_path), *asked)
    assert first.returncode == 0, first.stderr
    answer = json.loads(first.stdout)
    assert [each["name"] for each in answer["cameras"]] == ["A", "B", "C"]
    assert (answer["page"], answer["rehearsal"]) == ("https://hillpc.local:8123/", None)
    assert len(answer["backups"]) == 2
    options = ServiceOptions.read(tmp_path / "options")
    assert options.text.startswith("# mine\n")
    assert options.values("--preroll") == ("9",)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}

    # Today's answers are the defaults: the second time nothing changes.
    again = run_svev("setup", "--folder", str(tmp_path), *network(loopback), "--yes", "--no-rehearse", "--json")

    assert (json.loads(again.stdout)["written"], json.loads(again.stdout)["backups"]) == ([], []), again.stdout
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before

    # A camera that is off does not fall out of the rig because nobody was asked.
    text = (tmp_path / "rig.toml").read_text()
    (tmp_path / "rig.toml").write_text(text.replace(cameras[1], loopback.cameras(4)[3]))
    off = run_svev("setup", "--folder", str(tmp_path), *network(loopback), "--yes", "--no-rehearse", "--json")
    assert [each["name"] for each in json.loads(off.stdout)["cameras"]] == ["A", "B", "C"]
    assert f"B={loopback.cameras(4)[3]} of the rig file does not answer" in off.stderr
    (tmp_path / "rig.toml").write_text(text)

    fewer = run_svev(
        "setup", "--folder", str(tmp_path), "--camera", cameras[1], "--trigger", "software", "--no-phones", "--yes",
        "--no-rehearse",
    )  # fmt: skip
    assert fewer.returncode == 0, fewer.stderr
    rig = load_rig(tmp_path / "rig.toml")
    assert [(each.name, each.address) for each in rig.cameras] == [("B", cameras[1])]
    assert (rig.trigger.source, rig.trigger.settle_s) == ("software", 60.0)
    assert ServiceOptions.read(tmp_path / "options").words == ("--preroll", "9", "--port", "8123")


def test_without_cameras_it_says_what_to_look_at_and_takes_addresses(tmp_path: Path, loopback: Loopback) -> None:
    none = run_svev("setup", "--folder", str(tmp_path / "hill"), *network(loopback), "--yes")
    assert (none.returncode, "no camera answers: check power and cables" in none.stderr) == (2, True)
    assert not (tmp_path / "hill").exists()
    missing = loopback.cameras(2)
    with Terminal("setup", "--folder", str(tmp_path / "hill"), *network(loopback), "--no-rehearse") as terminal:
        terminal.answer("[en]", "nb")
        terminal.answer("Hva heter bakken? [hill]", "Midtstubakken")
        terminal.answer("Ingen kameraer svarer. Sjekk strøm og kabler", "")
        terminal.answer("Enter leter igjen; eller skriv adressene", "192.168.11")
        terminal.answer("is no address of a camera", f"venstre={missing[0]} {missing[1]}")
        terminal.await_text(f"venstre={missing[0]} svarer ikke nå; det blir skrevet opp likevel")
        terminal.answer("Hvilken av dem? [external]", "")
        terminal.answer("Hvor mange pulser i sekundet? [30]", "50")
        terminal.answer("triggerkabelen til? [Line1]", "")
        terminal.answer("[ingen]", "")
        terminal.answer("Mappe for opptakene:", "")
        terminal.answer("Skal telefoner og andre datamaskiner nå siden? [ja]", "nei")
        assert terminal.end() == 0, terminal.shown
    rig = load_rig(tmp_path / "hill" / "rig.toml")
    assert [(each.name, each.address) for each in rig.cameras] == [("venstre", missing[0]), ("K1", missing[1])]
    assert (rig.name, rig.trigger.rate_hz, rig.cameras[0].trigger_input) == ("Midtstubakken", 50.0, "Line1")
    assert rig.recorder.directory == tmp_path / "hill" / "recordings"


@pytest.mark.parametrize("question", ["English or Norwegian", "Looking for cameras", "HTTPS; phones"])
def test_who_leaves_finds_everything_as_it_was(tmp_path: Path, loopback: Loopback, question: str) -> None:
    published(tmp_path, loopback)
    before = (tmp_path / "rig.toml").read_bytes()
    answered = [
        "--name",
        "new",
        "--trigger",
        "external",
        "--rate",
        "30",
        "--trigger-input",
        "Line0",
        "--survey",
        "none",
    ]
    answered += ["--recordings", str(tmp_path / "recordings"), "--phones", "--call", "hillpc.local"]
    if question != "Looking for cameras":
        answered += ["--camera", loopback.cameras(1)[0]]
    with Terminal("setup", "--folder", str(tmp_path), *network(loopback), *answered) as terminal:
        if question != "English or Norwegian":
            terminal.answer("[en]", "")
        terminal.await_text(question)
        if question == "English or Norwegian":
            terminal.send_signal(signal.SIGHUP)  # the window is closed
        else:
            terminal.type("\x03")
        assert (terminal.end(), "ended; nothing has been changed" in terminal.shown) == (130, True), terminal.shown
    assert {path.name for path in tmp_path.iterdir()} == {"rig.toml"}
    assert (tmp_path / "rig.toml").read_bytes() == before


def test_who_cannot_be_asked_is_told_how_to_answer(tmp_path: Path) -> None:
    done = run_svev("setup", "--folder", str(tmp_path))
    assert (done.returncode, "answer by options, and add --yes" in done.stderr) == (2, True), done.stderr
    refused = {
        ("--camera", "K1=nowhere"): "is no address of a camera",
        ("--network", "everywhere"): "give one like 192.168.11.0/24",
        ("--camera", "127.0.0.1", "--trigger", "me"): "--trigger me: give one of external",
        ("--camera", "127.0.0.1", "--camera", "127.0.0.1"): "is there twice",
        ("--camera", "127.0.0.1", "--trigger", "iidc-broadcast"): "not all of these cameras take such commands",
        ("--camera", "recorder=127.0.0.1", "--no-phones"): f"{tmp_path}/hill/rig.toml: recorder is the name of a part",
    }
    for options, words in refused.items():
        done = run_svev("setup", "--folder", str(tmp_path / "hill"), *options, "--yes")
        assert (done.returncode, words in done.stderr) == (2, True), done.stderr
    assert list(tmp_path.iterdir()) == []
