import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from rig.errors import BadInputError
from rig.settings.file import CONFIG, load_rig, rig_schema
from rig.settings.strict_toml import read_toml
from rig.settings.trigger import ExternalTrigger
from tests.support import rig_keys

RIGS = sorted((CONFIG / "rigs").glob("*.toml"))

CAMERA = '[[cameras]]\nname = "K1"\nbackend = "aravis"\naddress = "192.168.11.2"\n'
SECOND = CAMERA.replace("K1", "K2").replace("11.2", "12.2")
REPLAYED = '[[cameras]]\nname = "K1"\nbackend = "replay"\naddress = "log.mcap"\n'
HEAD = 'name = "test rig"\n'


def _complaint(folder: Path, text: str) -> str:
    """The error message for `text` as a rig file, without the path with which it must begin."""
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInputError) as caught:
        load_rig(path)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 600
    assert line.isprintable()
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_shipped_rig_files_are_valid(path: Path) -> None:
    rig = load_rig(path)
    assert len(rig.cameras) == 3
    jsonschema.validate(read_toml(path), json.loads(rig_schema()))


def test_the_rig_files_of_the_contract_are_shipped() -> None:
    assert {"hill-iidc", "hill-gige", "sim"} <= {path.stem for path in RIGS}


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_the_scenario_of_a_shipped_rig_file_exists(path: Path) -> None:
    simulation = load_rig(path).simulation
    if simulation is not None:
        assert simulation.scenario.is_file()


def test_the_shipped_schema_is_up_to_date() -> None:
    assert (CONFIG / "rig.schema.json").read_text(encoding="utf-8") == rig_schema(), (
        "run: svev schema -o config/rig.schema.json"
    )


def test_the_page_on_the_rig_file_has_the_keys_of_the_schema() -> None:
    page = rig_keys.PAGE.read_text(encoding="utf-8")
    assert page == rig_keys.written_in(page), "run: python -m tests.support.rig_keys"
    for key in ("settle_s", "packet_socket", "resend"):
        assert f"| `{key}` |" in page


def test_the_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(json.loads(rig_schema()))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        pytest.param(
            "name = \nx",
            "not valid TOML: Invalid value (at line 1, column 8); correct it there",
            id="broken TOML",
        ),
        pytest.param(
            HEAD + CAMERA + "exposure = 5\n",
            'unknown key "cameras.1.exposure"; did you mean "exposure_us"?',
            id="misspelt",
        ),
        pytest.param(
            HEAD + REPLAYED + "gain_raw = 5\n",
            '"cameras.1": gain_raw is for backend "aravis" only, K1 is "replay"',
            id="steps of others",
        ),
        pytest.param(
            HEAD + CAMERA + "gain_raw = 5\ngain_db = 1\n", '"cameras.1": K1 has gain_raw and gain_db', id="gain twice"
        ),
        pytest.param(
            HEAD + CAMERA + '[offload]\nstore = "s3://jumps"\nstore_options = { key = "x" }\n',
            '"offload.store_options": key is a secret, and others read this file: remove it here',
            id="secret",
        ),
        pytest.param(
            HEAD + CAMERA + "[recorder]\nzzz = 1\n",
            'unknown key "recorder.zzz"; known keys here: directory, ',
            id="unknown",
        ),
        pytest.param(
            HEAD + "triger = {}\n" + CAMERA, 'unknown key "triger"; did you mean "trigger"?', id="unknown table"
        ),
        pytest.param(
            HEAD + CAMERA + "region = { widht = 5 }\n",
            'unknown key "cameras.1.region.widht"; did you mean "width"?',
            id="deep",
        ),
        pytest.param(
            HEAD + "[simulation]\nscenari = 'x'\n" + CAMERA.replace("aravis", "sim"),
            'unknown key "simulation.scenari"; did you mean "scenario"?',
            id="a required key is misspelt: one mistake, told once",
        ),
        pytest.param(
            HEAD + CAMERA.replace("backend", "backned").replace("name =", "nmae =") + "zzz = 1\n",
            'unknown key "cameras.1.nmae"; did you mean "name"? (and 3 more)',
            id="misspelt keys first",
        ),
        pytest.param(
            HEAD + "[simulation]\nzzz = 'x'\n" + CAMERA.replace("aravis", "sim"),
            'key "simulation.scenario" is missing; add it (and 1 more)',
            id="two at once",
        ),
        pytest.param(
            HEAD + CAMERA + 'exposure_us = "fast"\n', 'key "cameras.1.exposure_us" = \'fast\': ', id="wrong type"
        ),
        pytest.param(
            HEAD + CAMERA + "exposure_us = -1\n",
            'key "cameras.1.exposure_us" = -1: input should be greater than 0; correct it',
            id="out of range",
        ),
        pytest.param(CAMERA, 'key "name" is missing; add it', id="missing key"),
        pytest.param(HEAD, 'key "cameras" is missing; add it', id="no camera"),
        pytest.param(
            HEAD + "[trigger]\nmin_cameras = 2\n" + CAMERA,
            "trigger.min_cameras = 2, but the rig has 1 cameras: make it 1 or less, or leave it out",
            id="more cameras wanted than there are",
        ),
        pytest.param(
            HEAD + CAMERA.replace("K1", "Recorder"),
            "Recorder is the name of a part of Svev: give the camera another name",
            id="name of a process",
        ),
        pytest.param(HEAD + CAMERA + CAMERA, "camera name K1 is used twice: give each camera its own", id="same name"),
        pytest.param(
            HEAD + CAMERA + CAMERA.replace("K1", "K2"),
            "address 192.168.11.2 is used twice: give each camera its own",
            id="same address",
        ),
        pytest.param(
            HEAD + CAMERA.replace('address = "192.168.11.2"\n', ""),
            '"cameras.1": backend "aravis" needs an address: add address = "..."',
            id="no address",
        ),
        pytest.param(
            HEAD + CAMERA + SECOND + 'pixel_format = "Mono12"\n',
            "cameras differ in pixel_format (K1 Mono8, K2 Mono12): one image holds all frames of a pulse, so choose",
            id="bits",
        ),
        pytest.param(
            HEAD + CAMERA + 'pixel_format = "Mono10p"\nregion = { width = 642 }\n',
            '"cameras.1": region.width of K1 is 642: in Mono10p 4 pixels stand together, so make it a multiple of 4',
            id="groups",
        ),
        pytest.param(
            HEAD + '[[cameras]]\nname = "K1"\nbackend = "sim"\n',
            'backend "sim" needs a [simulation] table: add scenario = ',
            id="sim without scenario",
        ),
        pytest.param(
            HEAD + REPLAYED + SECOND,
            'camera K2 has backend "aravis", K1 "replay": pulses of a log are not those of other cameras; use backend',
            id="replay beside others",
        ),
        pytest.param(
            HEAD + REPLAYED + REPLAYED.replace("K1", "K2").replace("log", "other"),
            "replayed cameras have different logs, whose pulses have nothing to do with each other: give all cameras",
            id="two logs",
        ),
        pytest.param(
            HEAD + CAMERA + '[network]\npublish = "127.0.0.1"\n',
            'key "network.publish" = \'127.0.0.1\': ',
            id="publish address",
        ),
        pytest.param(
            HEAD + "cameras = " + "[" * 10_000 + "]" * 10_000,
            "not valid TOML: nested too deeply; correct it there",
            id="deep arrays",
        ),
        pytest.param(
            HEAD + "x" + ".x" * 2_000 + " = 1\n" + CAMERA,
            "not valid TOML: nested too deeply; correct it there",
            id="deep tables",
        ),
        pytest.param(
            HEAD + CAMERA + "exposure_us = " + "9" * 10_000 + "\n", "not valid TOML: Exceeds the limit", id="digits"
        ),
        pytest.param(
            HEAD + CAMERA + "exposure_us = 0x" + "f" * 10_000 + "\n",
            'key "cameras.1.exposure_us" = a number of many digits: ',
            id="hexadecimal digits",
        ),
        pytest.param(
            HEAD + CAMERA + "exposure_us = " + "9" * 4000 + "\n", 'key "cameras.1.exposure_us" = 9999', id="4000 digits"
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nrate_hz = 1e-300\n",
            'key "trigger.rate_hz" = 1e-300: input should be greater than or equal to 0.1; correct it',
            id="rate almost 0",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'hand'\n",
            "key \"trigger.source\" = 'hand': there is \"external\", \"software\", \"action\", \"iidc-broadcast\", "
            '"triggerbox", "gpio"; correct it',
            id="unknown source",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'software'\nrate = 5\n",
            'unknown key "trigger.rate"; did you mean "rate_hz"?',
            id="unknown key of a source",
        ),
        pytest.param(
            HEAD + CAMERA.replace("aravis", "sim") + "[trigger]\nsource = 'software'\n"
            "[simulation]\nscenario = 'x.toml'\n",
            'trigger.source "software" is a command to each camera, and K1 with backend "sim" takes none: '
            'use source = "external"',
            id="cameras that take no commands",
        ),
        pytest.param(
            HEAD + CAMERA.replace("aravis", "iidc").replace("192.168.11.2", "000a4701011b0001")
            + "[trigger]\nsource = 'action'\n",
            'trigger.source "action" is a command to GigE Vision cameras, and K1 has backend "iidc"',
            id="action commands on FireWire",
        ),
        pytest.param(
            HEAD + CAMERA.replace("192.168.11.2", "K1.local") + "[trigger]\nsource = 'action'\n",
            'trigger.source "action" needs the IPv4 address of K1, by which its answers are known',
            id="action commands to a name",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'action'\nscheduled = true\nrate_hz = 500\nlead_ms = 20\n",
            '"trigger": trigger.lead_ms = 20 has cameras hold 10 commands at 500 Hz, and some hold only 4: make it ',
            id="too many scheduled commands",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'iidc-broadcast'\n",
            'trigger.source "iidc-broadcast" is a command to FireWire cameras, and K1 has backend "aravis": use source',
            id="a broadcast to a GigE Vision camera",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'gpio'\nline = 18\ngate = { line = 18 }\n",
            '"trigger": trigger.gate.line = 18 is the line of the pulses: name another one',
            id="a gate at the line of the pulses",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'gpio'\nline = 18\nrate_hz = 200\npulse_ms = 3\n",
            '"trigger": trigger.pulse_ms = 3 is more than half of the time between two pulses at 200 Hz: make it 2.5',
            id="pulses without an end",
        ),
        pytest.param(
            HEAD + CAMERA + "[trigger]\nsource = 'action'\nbroadcast = ['192.168.8']\n",
            '"trigger.broadcast.1": Expected 4 octets in',
            id="half an address",
        ),
        pytest.param(
            HEAD + CAMERA.replace("aravis", "iidc").replace("192.168.11.2", "000a4701011b0001")
            + "iidc = { trigger_mode = 1 }\n[trigger]\nsource = 'software'\n",
            "iidc.trigger_mode = 1 of K1 exposes for as long as the pulse lasts, and a command has no length",
            id="pulses that last",
        ),
        pytest.param(HEAD + CAMERA + "[trigger]\nrate_hz = nan\n", 'key "trigger.rate_hz" = nan: ', id="no number"),
        pytest.param(HEAD + CAMERA + "gain_db = -inf\n", 'key "cameras.1.gain_db" = -inf: ', id="infinite"),
        pytest.param(
            HEAD + CAMERA + "[recorder]\npreroll_limit_mb = inf\n",
            'key "recorder.preroll_limit_mb" = inf: input should be a finite number; correct it',
            id="endless pre-roll",
        ),
        pytest.param(
            HEAD + CAMERA.replace("192.168.11.2", "1" * 100_000),
            'key "cameras.1.address" has 100000 characters; shorten it',
            id="a long address",
        ),
        pytest.param(
            HEAD + "x = '" + "x" * 2_000_000 + "'\n" + CAMERA,
            "is larger than 1 MB, which no TOML file of svev is; name another file",
            id="a large file",
        ),
        pytest.param(
            HEAD + CAMERA + '[recorder]\ndirectory = "a\\u0000b"\n',
            'key "recorder.directory" holds the character \'\\x00\', which cannot be seen; remove it',
            id="NUL in a path",
        ),
        pytest.param(
            'name = "\\u001b[31mred"\n' + CAMERA,
            'key "name" holds the character \'\\x1b\', which cannot be seen; remove it',
            id="terminal escape",
        ),
        pytest.param(
            HEAD + '"\\u001b[2J" = 1\n' + CAMERA,
            'key "\\x1b[2J" holds the character \'\\x1b\', which cannot be seen; remove it',
            id="terminal escape in a key",
        ),
    ],
)  # fmt: skip
def test_a_wrong_rig_file_is_one_line_with_key_and_remedy(tmp_path: Path, text: str, complaint: str) -> None:
    assert _complaint(tmp_path, text).startswith(complaint)


def test_replayed_cameras_share_their_log(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(HEAD + REPLAYED + REPLAYED.replace("K1", "K2"))
    assert {camera.address for camera in load_rig(path).cameras} == {"log.mcap"}


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"none\.toml: no such file; name an existing one"):
        load_rig(tmp_path / "none.toml")


def test_a_directory_is_no_rig_file(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="is a directory; name the file in it"):
        load_rig(tmp_path)


def test_a_path_through_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BadInputError, match=r"cannot be read \(Not a directory\)"):
        load_rig(tmp_path / "file" / "rig.toml")


def test_frames_may_be_packed_and_of_different_sizes(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    packed = 'pixel_format = "Mono12Packed"\nregion = { width = 800, height = 100 }\n'
    path.write_text(HEAD + CAMERA + packed + SECOND + 'pixel_format = "Mono12"\n')
    rig = load_rig(path)
    assert [camera.frame_bytes for camera in rig.cameras] == [800 * 100 * 3 // 2, 640 * 480 * 2]
    assert (rig.triplet_shape, rig.triplet_bytes) == ((480, 1440), 480 * 1440 * 2)


def test_an_endless_file_is_no_rig_file() -> None:
    with pytest.raises(BadInputError, match="/dev/zero: is no file, but a device or a pipe; name a TOML file"):
        load_rig(Path("/dev/zero"))


def test_a_picture_is_no_rig_file(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_bytes(b"\x89PNG\xff")
    with pytest.raises(BadInputError, match="is no text file in UTF-8; save it so, or name a TOML file"):
        load_rig(tmp_path / "rig.toml")


def test_a_scenario_is_relative_to_its_rig_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(HEAD + "[simulation]\nscenario = 'hill.toml'\n" + CAMERA.replace("aravis", "sim"))
    simulation = load_rig(path).simulation
    assert simulation is not None
    assert simulation.scenario == tmp_path / "hill.toml"


#: Keys of the rig file that name a file or a folder, each with a rig file that has it, and how one gets at it.
PATHS: dict[str, tuple[str, Callable[[Any], Path]]] = {
    "calibration": ("calibration = '{}'\n", lambda rig: rig.calibration),
    "plan": ("plan = '{}'\n", lambda rig: rig.plan),
    "RecorderSettings.directory": ("[recorder]\ndirectory = '{}'\n", lambda rig: rig.recorder.directory),
    "RecorderSettings.fallback_directory": (
        "[recorder]\nfallback_directory = '{}'\n", lambda rig: rig.recorder.fallback_directory,
    ),
    "NetworkSettings.curve_key_file": ("[network]\ncurve_key_file = '{}'\n", lambda rig: rig.network.curve_key_file),
    "AnalysisSettings.survey": ("[analysis]\nsurvey = '{}'\n", lambda rig: rig.analysis.survey),
    "AnalysisSettings.calibration": ("[analysis]\ncalibration = '{}'\n", lambda rig: rig.analysis.calibration),
    "OffloadSettings.to": ("[offload]\nto = '{}'\n", lambda rig: rig.offload.to),
    "WebhookSettings.url_file": ("[service.webhook]\nurl_file = '{}'\n", lambda rig: rig.service.webhook.url_file),
    "WebhookSettings.token_file": (
        "[service.webhook]\nurl = 'https://club.example/x'\ntoken_file = '{}'\n",
        lambda rig: rig.service.webhook.token_file,
    ),
    "SimulationSettings.scenario": ("[simulation]\nscenario = '{}'\n", lambda rig: rig.simulation.scenario),
}  # fmt: skip


def test_every_path_says_where_it_begins_and_begins_there(tmp_path: Path) -> None:
    """The rule of `docs/reference/rig-file.md`: parts of the rig are relative to its file, recordings are not."""
    schema = json.loads(rig_schema())
    tables = {"": schema, **{f"{name}.": table for name, table in schema["$defs"].items()}}
    said = {
        f"{table}{key}": value["description"]
        for table, content in tables.items()
        for key, value in content.get("properties", {}).items()
        if '"format": "path"' in json.dumps(value)
    }
    assert set(said) == set(PATHS)
    path = tmp_path / "rig.toml"
    for key, (text, get) in PATHS.items():
        path.write_text(HEAD + (text + CAMERA if "." not in key else CAMERA + text).format("some/where"))
        to_the_rig = "relative to the rig file" in said[key]
        assert to_the_rig is not ("relative to the working directory" in said[key]), key
        assert get(load_rig(path)) == (tmp_path if to_the_rig else Path()) / "some" / "where", key


def test_a_calibration_is_relative_to_its_rig_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(HEAD + CAMERA)
    assert load_rig(path).calibration is None
    path.write_text(HEAD + "calibration = 'survey/poses.json'\n" + CAMERA)
    assert load_rig(path).calibration == tmp_path / "survey" / "poses.json"
    path.write_text(HEAD + "calibration = '/survey/poses.json'\n" + CAMERA)
    assert load_rig(path).calibration == Path("/survey/poses.json")


def test_frames_stand_side_by_side_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    wide = SECOND + "region = { width = 1936, height = 480 }\n"
    path.write_text(HEAD + wide + CAMERA)
    rig = load_rig(path)
    assert [camera.name for camera in rig.cameras] == ["K2", "K1"]
    assert rig.columns() == ((0, 1936), (1936, 2576))
    assert rig.triplet_shape == (480, 2576)
    assert rig.cameras[0].frame_bytes == 1936 * 480


def test_the_period_of_the_pulses_is_in_ns(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(HEAD + CAMERA + "[trigger]\nrate_hz = 30\n")
    assert load_rig(path).trigger == ExternalTrigger(rate_hz=30)
    assert load_rig(path).trigger.period_ns == 33_333_333
