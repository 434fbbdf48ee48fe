"""Files of measurements: what was written is read, hand-made ones are simple, wrong ones are refused in one line."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.measurements.file import read_measurements, write_measurements
from analysis.measurements.merging import merged
from analysis.measurements.model import JumpMeasurements, MeasuredCamera, Measurements, Source
from rig.errors import BadInputError
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "measurements-file.md"


@pytest.fixture(scope="module")
def measurements() -> Measurements:
    """Measurements with everything that a file can hold."""
    simulated = simulated_measurements(true_jump(1), true_cameras(), np.random.default_rng(1))
    first, *others = simulated.jumps[0].pulses[10:14]
    point = replace(first.images["K1"].points["P2"], covariance=np.array(((0.04, -0.01), (-0.01, 0.09))))
    ski = replace(first.images["K1"].skis["left"], common=0.25, source=Source.BY_HAND)
    image = replace(first.images["K1"], points={"P2": point}, skis={"left": ski})
    jump = JumpMeasurements(1, (replace(first, images={"K1": image}), *others))
    return replace(simulated, cameras={**simulated.cameras, "K3": MeasuredCamera((640, 480), 0.002)}, jumps=(jump,))


@pytest.fixture
def example() -> dict[str, Any]:
    """The example of the documentation."""
    found = re.search(r"```json\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def saved(tmp_path: Path, data: object) -> Path:
    """A file with this content."""
    path = tmp_path / "m.json"
    path.write_text(json.dumps(data))
    return path


def test_what_was_written_is_read(measurements: Measurements, tmp_path: Path) -> None:
    path = tmp_path / "measurements.json"
    write_measurements(measurements, path)
    back = read_measurements(path)
    assert (back.recording, back.rate_hz, list(back.cameras)) == ("simulated", 30.0, ["K1", "K2", "K3"])
    assert (back.cameras["K3"].size, back.cameras["K3"].exposure_s) == ((640, 480), 0.002)
    assert [jump.number for jump in back.jumps] == [1]
    for here, there in zip(measurements.jumps[0].pulses, back.jumps[0].pulses, strict=True):
        assert (here.pulse, here.time) == (there.pulse, there.time)
        assert here.images.keys() == there.images.keys()
        for name, image in here.images.items():
            assert image.points.keys() == there.images[name].points.keys()
            for label, point in image.points.items():
                other = there.images[name].points[label]
                np.testing.assert_allclose(other.xy, point.xy, atol=6e-5)  # written to 0.0001 px
                np.testing.assert_allclose(other.covariance, point.covariance, rtol=1e-5, atol=1e-9)
                assert other.source is point.source
            for side, ski in image.skis.items():
                found = there.images[name].skis[side]
                np.testing.assert_allclose(found.xy, ski.xy, atol=6e-5)
                np.testing.assert_allclose(found.sigma, ski.sigma)
                assert (found.common, found.source) == (ski.common, ski.source)
    assert '"time_ns": "17' in path.read_text()


def test_the_example_of_the_documentation(example: dict[str, Any], tmp_path: Path) -> None:
    read = read_measurements(saved(tmp_path, example))
    first, second = read.jumps[0].pulses
    assert (first.pulse, second.pulse) == (94, 95)
    assert second.time - first.time == pytest.approx(1e9 / 30, abs=1)
    points = first.images["K1"].points
    np.testing.assert_allclose(points["P1"].covariance, 0.25 * np.eye(2))
    np.testing.assert_allclose(points["P2"].covariance, np.eye(2))
    np.testing.assert_allclose(first.images["K2"].points["P1"].covariance, np.diag((0.16, 0.36)))
    ski = first.images["K1"].skis["right"]
    np.testing.assert_allclose(ski.sigma, (0.5, 0.5))
    assert ski.source is points["P1"].source is Source.BY_HAND
    assert read.middle_s == pytest.approx(0.00025)
    assert read.late_s("K2") == pytest.approx(0.00025)


WRONG = {
    ("format",): ("svev-network/1", r'key "format" = .*svev-measurements/1'),
    ("rate_hz",): (0, r'key "rate_hz" = 0: .*; correct it'),
    ("rate",): (30, r'unknown key "rate"; did you mean "rate_hz"\?'),
    ("cameras", "K1", "size"): ([640], r'"cameras.K1.size" = .*2 at least'),
    ("cameras", "K1"): (
        {"size": [64, 48]},
        r"pulse 94, K1: P1 is at \(312.4, 201.7\), outside of its image of 64 x 48",
    ),
    ("cameras",): ({"K2": {"size": [640, 480]}}, r'pulse 94: "cameras" has no K1 \(there: K2\); add it there'),
    ("jumps", 0, "pulses", 1, "pulse"): (94, r"pulse 94 stands twice; put"),
    ("jumps", 0, "pulses", 1, "time_ns"): ("17", r'pulse 94 has no "time_ns", but others have; give'),
    ("jumps", 0, "pulses", 0, "time_ns"): (17, r'key "jumps.1.pulses.1.time_ns" = 17: .*string'),
    ("jumps", 0, "pulses", 0, "images", "K1", "points", "P5"): ({"xy": [1, 2]}, r"P5.*'P1', 'P2', 'P3' or 'P4'"),
    ("jumps", 0, "pulses", 0, "images", "K1", "points", "P1", "xy"): ([1, "2"], r"K1.points.P1.xy.2.*valid number"),
    ("jumps", 0, "pulses", 0, "images", "K1", "points", "P1", "sigma"): (0, r"P1.sigma.1\" = 0: .*greater than"),
    ("jumps", 0, "pulses", 0, "images", "K1", "points", "P1", "sigma "): (1, r'did you mean "sigma"'),
    ("jumps", 0, "pulses", 0, "images", "K1", "points", "P1", "correlation"): (1, r"P1.correlation.*less than 1"),
    ("jumps", 0, "pulses", 0, "images", "K1", "points", "P1", "source"): (
        "automatic",
        r'P1": an auto.* no "sigma"; add',
    ),
    ("jumps", 0, "pulses", 0, "images", "K1", "skis", "right", "xy"): ([[1, 2]], r"right.xy.*2 at least"),
    ("jumps", 0, "pulses", 0, "images", "K1", "skis", "right", "sigma"): ([1, 1, 1], r"3 numbers; give one, or 2: one"),
}


@pytest.mark.parametrize("keys", WRONG, ids=lambda keys: ".".join(map(str, keys[-2:])))
def test_wrong_files_are_refused_in_one_line(keys: tuple[str | int, ...], example: Any, tmp_path: Path) -> None:
    value, message = WRONG[keys]
    place = example
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    with pytest.raises(BadInputError, match=message) as caught:
        read_measurements(saved(tmp_path, example))
    assert str(caught.value).startswith(str(tmp_path / "m.json"))
    assert "\n" not in str(caught.value)


def test_numbers_that_are_not_finite_and_other_content(example: dict[str, Any], tmp_path: Path) -> None:
    example["jumps"][0]["pulses"][0]["images"]["K1"]["points"]["P1"]["xy"] = [float("nan"), 1.0]
    with pytest.raises(BadInputError, match="NaN is no number; write a finite one"):
        read_measurements(saved(tmp_path, example))
    with pytest.raises(BadInputError, match="is no JSON object; a file of measurements starts with"):
        read_measurements(saved(tmp_path, []))
    with pytest.raises(BadInputError, match="no such file; name an existing file of measurements"):
        read_measurements(tmp_path / "none.json")


def test_by_hand_counts_instead_of_automatic(example: dict[str, Any], tmp_path: Path) -> None:
    automatic = read_measurements(saved(tmp_path, example))
    pulses = example["jumps"][0]["pulses"]
    pulses[0]["images"] = {"K1": {"points": {"P1": {"xy": [310.0, 200.0]}}}, "K2": {"points": {"P3": {"xy": [1, 2]}}}}
    pulses[1]["pulse"] = 93
    both = merged(automatic, read_measurements(saved(tmp_path, example)))
    assert [pulse.pulse for pulse in both.jumps[0].pulses] == [93, 94, 95]
    images = both.jumps[0].pulses[1].images
    assert images["K1"].points["P1"].xy.tolist() == [310.0, 200.0]
    assert set(images["K1"].points) == {"P1", "P2"}
    assert set(images["K2"].points) == {"P1", "P3"}
    assert set(images["K1"].skis) == {"right"}
    with pytest.raises(BadInputError, match=r"of recording b, not of a; name their log"):
        merged(replace(automatic, recording="a"), replace(automatic, recording="b"))
    other = replace(automatic, jumps=(replace(automatic.jumps[0], number=2),))
    with pytest.raises(
        BadInputError, match=r'pulse 94 is of jump 1, but measured by hand as of jump 2; correct "number"'
    ):
        merged(automatic, other)
    larger = replace(automatic, cameras={"K1": MeasuredCamera((1280, 960), 0.0)})
    with pytest.raises(BadInputError, match=r"camera K1: images have 640 x 480 px, but were .* with 1280 x 960 px"):
        merged(automatic, larger)
