"""`jumper.json`: the contract's members, nothing invented, nothing lost on the way to the disk and back."""

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.result.file import read, to_json, write
from analysis.result.model import MeasuredRecording, Quantity
from rig.errors import BadInputError
from tests.analysis.result.recordings import HELMET_GAP, LEFT_SKI_GAP, TWO_RAYS, recording, without_takeoff


@pytest.fixture(scope="module")
def measured() -> MeasuredRecording:
    return recording(jumps=2)


def test_has_all_members_of_the_contract(measured: MeasuredRecording) -> None:
    data = to_json(measured)
    assert data["format"] == "svev-jumper/1"
    assert (data["length_unit"], data["angle_unit"]) == ("m", "deg")
    assert {"recording", "session", "orientation", "synchrony", "jumps"} <= data.keys()
    assert {"images", "balls", "moved", "messages"} <= data["orientation"].keys()
    image = data["orientation"]["images"]["K1"]
    assert {name: np.shape(value) for name, value in image.items()} == {
        "X0": (3,), "R": (3, 3), "sigma_X0": (3,), "sigma_angles": (3,)
    }  # fmt: skip
    ball = next(iter(data["orientation"]["balls"].values()))
    assert ball.keys() == {"role", "X", "sigma", "images"}
    assert {len(xy) for xy in ball["images"].values()} == {4}
    assert data["synchrony"]["K1"].keys() == {"offset_ms", "sigma_ms", "message", "said"}
    jump = data["jumps"][1]
    assert jump["number"] == 2
    assert jump["takeoff"].keys() == {"pulse", "sigma_pulses", "time_ns"}
    assert isinstance(jump["takeoff"]["time_ns"], str)
    assert jump["verdict"].keys() == {"ok", "message", "phases", "said"}
    assert jump["verdict"]["phases"].keys() == {"table", "edge", "flight"}
    for pulse in jump["pulses"]:
        assert {"pulse", "since_takeoff_s", "phase", "points", "skis", "angles", "height", "speed"} <= pulse.keys()
        for state in (pulse, pulse["smoothed"]):
            assert state["points"].keys() == {"P1", "P2", "P3", "P4"}
            assert state["skis"].keys() == {"right", "left"}
            assert state["angles"].keys() == {"alpha", "beta", "gamma", "dphi", "phi"}
        assert np.shape(pulse["smoothed"]["velocity"]["covariance"]) == (3, 3)
        assert pulse["smoothed"]["angle_of_attack"].keys() == {"value", "sigma"}


def test_what_was_not_measured_is_null_in_the_raw_part_and_predicted_in_the_smoothed(
    measured: MeasuredRecording,
) -> None:
    pulses = to_json(measured)["jumps"][0]["pulses"]
    hidden = pulses[HELMET_GAP[0]]
    assert hidden["points"]["P1"] is None
    assert hidden["fates"]["P1"]["fate"] == "images disagree"
    assert set(hidden["fates"]["P1"]["images"].values()) == {"not used"}
    assert hidden["fates"]["P2"]["fate"] == "used"
    assert hidden["angles"]["beta"] is None
    assert hidden["smoothed"]["points"]["P1"]["status"] == "predicted"
    assert pulses[LEFT_SKI_GAP[0]]["skis"]["left"] is None
    assert pulses[TWO_RAYS[0]]["points"]["P4"]["status"] == "two rays"
    assert pulses[0]["speed"] is None
    assert pulses[-1]["speed"] is None
    assert all(pulse["smoothed"] is None for pulse in to_json(without_takeoff(measured))["jumps"][0]["pulses"])


def test_numbers_that_are_not_finite_become_null(measured: MeasuredRecording) -> None:
    jump = measured.jumps[0]
    raw = replace(jump.pulses[0].raw, height=Quantity(1.0, np.nan))
    smoothed = jump.pulses[0].smoothed
    assert smoothed is not None
    smoothed = replace(smoothed, by_calibration=np.full_like(smoothed.by_calibration, np.nan), angle_of_attack=None)
    pulse = replace(jump.pulses[0], raw=raw, smoothed=smoothed)
    data = to_json(replace(measured, jumps=(replace(jump, pulses=(pulse,)),)))
    written = data["jumps"][0]
    assert written["pulses"][0]["height"] is None
    assert written["pulses"][0]["smoothed"]["by_calibration"] == [None] * 11
    assert written["tests"][-1]["w"] is None
    json.dumps(data, allow_nan=False)


def test_reading_gives_what_was_written(measured: MeasuredRecording, tmp_path: Path) -> None:
    orientation = measured.orientation
    shared = replace(orientation, given="survey", given_covariance=orientation.covariance / 2)
    for given in (measured, without_takeoff(measured), replace(measured, orientation=shared)):
        write(given, tmp_path / "jumper.json")
        _assert_same(read(tmp_path), given)
    assert [path.name for path in tmp_path.iterdir()] == ["jumper.json"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"svev-jumper/1"', '"svev-jumper/2"', "format"),
        ('"right": {"direction": [', '"right": {"direction": [1.0, ', "direction"),
        ('"source"', '"sauce"', "source"),
        ('"K1.X0", ', "", "covariance"),
        ('"phase": "edge"', '"phase": "landing"', "phase"),
        ('"height": {"value": ', '"height": {"value": "much", "was": ', "height"),
        ('"by_calibration": [[', '"by_calibration": [[0.0, ', "by_calibration"),
        ("}", "", "svev analyze"),
    ],
)
def test_what_is_no_such_file_is_refused_in_one_line(
    measured: MeasuredRecording, tmp_path: Path, old: str, new: str, says: str
) -> None:
    text = json.dumps(to_json(measured))
    assert old in text
    (tmp_path / "jumper.json").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(BadInputError, match=says) as refused:
        read(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="no such file; name a folder that svev analyze wrote"):
        read(tmp_path)


def _assert_same(one: Any, other: Any) -> None:
    """Equal in all members; derivatives to the six digits that the file gives them."""
    if is_dataclass(one):
        assert type(one) is type(other)
        for member in fields(one):
            a, b = getattr(one, member.name), getattr(other, member.name)
            if member.name == "by_calibration":
                np.testing.assert_allclose(a, b, rtol=1e-5)
            else:
                _assert_same(a, b)
    elif isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            _assert_same(one[key], other[key])
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            _assert_same(a, b)
    else:
        assert one == other or (np.isnan(one) and np.isnan(other))


def test_a_result_from_before_the_fates_is_read(measured: MeasuredRecording, tmp_path: Path) -> None:
    data = to_json(measured)
    for jump in data["jumps"]:
        for pulse in jump["pulses"]:
            del pulse["fates"]
    path = tmp_path / "jumper.json"
    path.write_text(json.dumps(data))
    assert all(not pulse.fates for jump in read(path).jumps for pulse in jump.pulses)
