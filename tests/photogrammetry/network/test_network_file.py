"""Network files: a valid file is read back unchanged; an invalid one is refused with file, key and remedy."""

import copy
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.network.file import network_from_json, read_network
from photogrammetry.network.file_writer import network_to_json, write_network
from photogrammetry.network.model import Network, Reweight, Role
from rig.errors import BadInputError
from tests.photogrammetry.synthetic import rods

_GOOD: dict[str, Any] = {
    "format": "svev-network/1",
    "length_unit": "m",
    "image_frame": "pixel",
    "sigma0": 2.0,
    "cameras": {
        "K1": {"size": [640, 480], "c": 1400, "a1": 1e-8, "estimate": ["a1", "c"], "sigma": {"c": 5.0}},
    },
    "images": {
        "i1": {"camera": "K1", "X0": [0, -4, 1], "R": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "sigma": {"X0": [1, 1, 2]}},
        "i2": {"camera": "K1", "X0": None, "R": None},
    },
    "points": {
        "B7": {"role": "control", "X": [12.31, 4.02, 1.77], "sigma": [0.012, 0.012, 0.02]},
        "F1": {"role": "tie", "X": None},
        "C2": {"role": "check", "X": [3.1, 0.2, 1.0]},
        "P0": {"role": "fixed", "X": [0, 0, 0]},
    },
    "observations": [
        ["i1", "F1", 311.42, 207.93, 0.33],
        ["i1", "B7", 319.5, 239.5, 0.33, 0.5],
        ["i2", "F1", 0, 0, 0.33, "helmet"],
    ],
    "distances": [{"from": "B7", "to": "F1", "value": 2.0, "sigma": 0.001}],
    "differences": [{"from": "B7", "to": "F1", "axis": "X", "value": 0.0, "sigma": 0.02}],
    "datum": {"type": "inner", "points": ["F1", "C2"]},
    "reweight": "paper",
}


def test_everything_is_read() -> None:
    network = network_from_json(_GOOD, "good.json")
    camera, image = network.cameras[0], network.images[0]
    assert (camera.estimate, camera.sigma, camera.size) == (("c", "a1"), {"c": 5.0}, (640, 480))
    assert image.sigma_position is not None
    assert image.sigma_position.tolist() == [1.0, 1.0, 2.0]
    assert image.sigma_angles is None
    assert network.images[1].position is None
    assert [point.role for point in network.points] == [Role.CONTROL, Role.TIE, Role.CHECK, Role.FIXED]
    assert network.datum.points == (1, 2)
    assert network.reweight is Reweight.PAPER
    assert network.sigma0 == 2.0


def test_pixels_become_metric_coordinates() -> None:
    observed = network_from_json(_GOOD, "good.json").observations
    assert observed.xy[1].tolist() == [0.0, 0.0]  # the middle of the image
    assert observed.xy[2].tolist() == [-319.5, 239.5]  # centre of the top left pixel
    assert observed.sigma.tolist() == [[0.33, 0.33], [0.33, 0.5], [0.33, 0.33]]
    assert [observed.groups[i] for i in observed.group] == ["image", "image", "helmet"]


def _leaves(value: Any) -> list[Any]:
    """All keys and values of nested JSON in order; numbers rounded, because reading makes R orthonormal."""
    if isinstance(value, dict):
        return [leaf for key, item in value.items() for leaf in (key, *_leaves(item))]
    if isinstance(value, list):
        return [leaf for item in value for leaf in _leaves(item)]
    return [round(value, 9) + 0.0 if isinstance(value, float) else value]


@pytest.mark.parametrize("network", [network_from_json(_GOOD, "good.json"), rods(1).network], ids=["good", "rods"])
def test_what_is_written_is_read_again(network: Network, tmp_path: Path) -> None:
    path = tmp_path / "network.json"
    write_network(network, path)
    again = read_network(path)
    assert _leaves(network_to_json(again)) == _leaves(network_to_json(network))
    assert np.abs(again.observations.xy - network.observations.xy).max() < 1e-12


def test_a_mark_of_byte_order_does_no_harm(tmp_path: Path) -> None:
    """Programs on Windows put it before a text that they save as UTF-8."""
    path, marked = tmp_path / "network.json", tmp_path / "marked.json"
    write_network(network_from_json(_GOOD, "good.json"), path)
    marked.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert network_to_json(read_network(marked)) == network_to_json(read_network(path))


Change = Callable[[dict[str, Any]], object]

#: What is changed in the good file, and what the error must say: the place, and what to do.
_BAD: dict[str, tuple[Change, str]] = {
    "tiny sigma": (lambda n: n["points"]["B7"].update(sigma=[1e-70, 1, 1]), "B7.*is smaller than 1e-60, which no unit"),
    "other format": (lambda d: d.update(format="svev-network/2"), r"format.*svev-network/1"),
    "no cameras": (lambda d: d.pop("cameras"), r'"cameras" is missing; add it'),
    "unknown key": (lambda d: d.update(observation=[]), r'unknown key "observation"; did you mean "observations"'),
    "frame": (lambda d: d.update(image_frame="px"), r"image_frame.*correct it"),
    "sigma0": (lambda d: d.update(sigma0=0), r"sigma0.*correct it"),
    "reweight": (lambda d: d.update(reweight="yes"), r"reweight"),
    "size missing": (lambda d: d["cameras"]["K1"].pop("size"), r'cameras\.K1: key "size" is missing'),
    "size of one": (lambda d: d["cameras"]["K1"].update(size=[640]), r"cameras\.K1: .*size.*correct it"),
    "size beyond all bounds": (
        lambda d: d["cameras"]["K1"].update(size=[10**25, 480]),
        r"cameras\.K1: .*size.*correct it",
    ),
    "negative c": (lambda d: d["cameras"]["K1"].update(c=-1400), r"cameras\.K1: .*\"c\".*correct it"),
    "c as text": (lambda d: d["cameras"]["K1"].update(c="1400"), r"cameras\.K1: .*\"c\".*correct it"),
    "c as truth": (lambda d: d["cameras"]["K1"].update(c=True), r"cameras\.K1: .*\"c\".*correct it"),
    "parameter": (lambda d: d["cameras"]["K1"].update(estimate=["f"]), r'cameras\.K1: "estimate" names "f"; the param'),
    "parameter twice": (lambda d: d["cameras"]["K1"].update(estimate=["c", "c"]), r"twice; remove one"),
    "sigma of constant": (lambda d: d["cameras"]["K1"].update(sigma={"x0": 1}), r'"x0", which "estimate" lacks; add'),
    "distortion": (lambda d: d["cameras"]["K1"].update(distortion="both"), r"cameras\.K1: .*distortion"),
    "camera is a list": (lambda d: d["cameras"].update(K1=[]), r"cameras\.K1: is no object"),
    "unknown camera": (lambda d: d["images"]["i1"].update(camera="K9"), r"images\.i1: camera 'K9' is not listed"),
    "X0 of two": (lambda d: d["images"]["i1"].update(X0=[1, 2]), r"images\.i1: .*X0.*correct it"),
    "no rotation": (
        lambda d: d["images"]["i1"].update(R=[[1, 0, 0], [0, 2, 0], [0, 0, 1]]),
        r"images\.i1: .*orthonorm",
    ),
    "reflection": (
        lambda d: d["images"]["i1"].update(R=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]),
        r"images\.i1: .*reflectio",
    ),
    "constant without pose": (lambda d: d["images"]["i2"].update(estimate=False), r'images\.i2: .*add "X0" and "R"'),
    "constant with sigma": (lambda d: d["images"]["i1"].update(estimate=False), r"images\.i1: .*drop it or estimate"),
    "sigma without pose": (lambda d: d["images"]["i2"].update(sigma={"X0": [1, 1, 1]}), r"images\.i2: .*drop it"),
    "role": (lambda d: d["points"]["F1"].update(role="free"), r"points\.F1: .*role.*'tie'"),
    "control without sigma": (lambda d: d["points"]["B7"].pop("sigma"), r"points\.B7: .*make the point fixed"),
    "control without X": (lambda d: d["points"]["B7"].update(X=None), r'points\.B7: .*add "X"'),
    "tie with sigma": (lambda d: d["points"]["F1"].update(sigma=[1, 1, 1]), r"points\.F1: .*drop it"),
    "sigma of zero": (
        lambda d: d["points"]["B7"].update(sigma=[0, 1, 1]),
        r"points\.B7: .* greater than 0; correct it",
    ),
    "observation too short": (
        lambda d: d["observations"].append(["i1", "C2", 1.0]),
        r"observations\.3: .*write \[image",
    ),
    "observation too long": (
        lambda d: d["observations"].append(["i1", "C2", 1, 2, 3, 4, 5]),
        r"observations\.3: has 5 numbers; write",
    ),
    "observation as object": (lambda d: d["observations"].append({}), r"observations\.3: .*write \[image"),
    "unknown image": (lambda d: d["observations"].append(["i9", "C2", 1, 2, 1]), r"observations\.3: image 'i9' is not"),
    "unknown point": (lambda d: d["observations"].append(["i1", "X", 1, 2, 1]), r"observations\.3: point 'X' is not"),
    "point as number": (lambda d: d["observations"].append(["i1", 7, 1, 2, 1]), r"observations\.3: point 7 is not"),
    "observed twice": (
        lambda d: d["observations"].append(["i1", "F1", 1, 2, 1]),
        r"observations\.3: .*observations\.0",
    ),
    "no sigma": (
        lambda d: d["observations"].append(["i1", "C2", 1, 2, 0]),
        r"observations\.3: sigma 0 is not positive",
    ),
    "text for x": (
        lambda d: d["observations"].append(["i1", "C2", "1", 2, 1]),
        r"observations\.3: '1' is no number in range",
    ),
    "null for x": (
        lambda d: d["observations"].append(["i1", "C2", None, 2, 1]),
        r"observations\.3: None is no number in range",
    ),
    "beyond all bounds": (lambda d: d["points"]["B7"].update(X=[0, 1e300, 0]), r"points\.B7: .*X.*correct it"),
    "x beyond all bounds": (
        lambda d: d["observations"].append(["i1", "C2", 1e300, 2, 1]),
        r"observations\.3: 1e\+300 is",
    ),
    "reserved group": (
        lambda d: d["observations"].append(["i1", "C2", 1, 2, 1, "control"]),
        r'observations\.3: group "control".*choose another',
    ),
    "distance to nobody": (lambda d: d["distances"][0].update(to="Q"), r"distances\.0: point 'Q' is not listed"),
    "distance to itself": (lambda d: d["distances"][0].update(to="B7"), r"distances\.0: goes from 'B7' to itself"),
    "negative distance": (lambda d: d["distances"][0].update(value=-2), r"distances\.0: .*value.*correct it"),
    "axis": (lambda d: d["differences"][0].update(axis="x"), r"differences\.0: .*axis"),
    "difference without sigma": (lambda d: d["differences"][0].pop("sigma"), r'differences\.0: key "sigma" is missing'),
    "datum type": (lambda d: d.update(datum={"type": "free"}), r"datum: .*type"),
    "datum point": (lambda d: d["datum"].update(points=["Q"]), r"datum: point 'Q' is not listed"),
    "fixed datum point": (lambda d: d["datum"].update(points=["P0"]), r"datum: point 'P0' is fixed"),
    "points of control": (lambda d: d["datum"].update(type="control"), r'datum: "points" belong to an inner datum'),
}


@pytest.mark.parametrize(("change", "message"), _BAD.values(), ids=_BAD.keys())
def test_malformed_networks_are_refused(change: Change, message: str) -> None:
    data = copy.deepcopy(_GOOD)
    change(data)
    with pytest.raises(BadInputError) as caught:
        network_from_json(data, "bad.json")
    text = str(caught.value)
    assert text.startswith("bad.json: ")
    assert "\n" not in text
    assert re.search(message, text), text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not valid JSON: .*line 1.*correct it"),
        ("", "is empty; name an existing network file"),
        ("[]", "is no JSON object"),
        ('{"sigma0": NaN}', "NaN is no number"),
        ('{"sigma0": -Infinity}', "-Infinity is no number"),
        ('{"points": {"A": 1, "A": 2}}', 'key "A" stands twice'),
        ("[" * 100_000, "not valid JSON"),
        (f'{{"sigma0": {"9" * 5000}}}', "9999.*too many digits"),
        ('{"length_unit": "\\ud800"}', "half a character"),
    ],
)
def test_files_that_are_no_networks(content: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.json"
    path.write_text(content)
    with pytest.raises(BadInputError, match=rf"broken\.json: {message}"):
        read_network(path)


def test_missing_unreadable_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"nowhere\.json: no such file; name"):
        read_network(tmp_path / "nowhere.json")
    with pytest.raises(BadInputError, match="is a directory; name the file in it"):
        read_network(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\x00\x01")
    with pytest.raises(BadInputError, match="is no text file in UTF-8; save it so, or name a JSON file"):
        read_network(tmp_path / "binary")
    (tmp_path / "windows").write_text("{}", encoding="utf-16")
    with pytest.raises(BadInputError, match="is text in UTF-16; save it as UTF-8"):
        read_network(tmp_path / "windows")
