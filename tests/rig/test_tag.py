import json

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import DeviceNs, UtcNs
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import TAG_SCHEMA, CameraTag, TripletTag
from rig.transport import wire

INT64 = st.integers(-(2**63), 2**63 - 1)
VALIDATOR = jsonschema.Draft202012Validator(TAG_SCHEMA)


def _camera(status: FrameStatus, frame_id: int, device: int, host: int, offset_us: float) -> CameraTag:
    if status is not FrameStatus.OK:
        return CameraTag("K1", (0, 640), status)
    return CameraTag(
        "K1", (0, 640), status, frame_id, frame_id % 1000, DeviceNs(device), UtcNs(host), round(offset_us, 3)
    )


cameras = st.builds(
    _camera, st.sampled_from(FrameStatus), st.integers(0, 2**64 - 1), INT64, INT64, st.floats(-1e6, 1e6)
)
tags = st.builds(
    TripletTag,
    st.integers(1, 2**53).map(PulseNumber),
    INT64.map(UtcNs),
    st.text(),
    st.text(),
    st.tuples(st.integers(1, 5000), st.integers(1, 15000)),
    st.lists(cameras, min_size=1, max_size=4).map(tuple),
)


@given(tags)
def test_what_is_encoded_is_decoded(tag: TripletTag) -> None:
    assert TripletTag.decode(tag.encode()) == tag


@given(tags)
def test_every_tag_keeps_the_schema(tag: TripletTag) -> None:
    VALIDATOR.validate(json.loads(tag.encode()))


@given(tags)
def test_a_tag_is_complete_when_every_frame_came(tag: TripletTag) -> None:
    assert json.loads(tag.encode())["complete"] == all(c.status is FrameStatus.OK for c in tag.cameras)


def test_the_contract_is_kept_to_the_letter() -> None:
    ok = CameraTag("K1", (0, 640), FrameStatus.OK, 7, 9, DeviceNs(2**62 + 1), UtcNs(1_795_216_434_399_239_001), 1.5)
    gone = CameraTag("K2", (640, 1280), FrameStatus.MISSED)
    tag = TripletTag(PulseNumber(1234), UtcNs(1_795_216_434_399_239_000), "training", "r1", (480, 1280), (ok, gone))
    assert json.loads(tag.encode()) == {
        "pulse": 1234,
        "time_ns": "1795216434399239000",
        "complete": False,
        "session": "training",
        "recording": "r1",
        "shape": [480, 1280],
        "dtype": "uint8",
        "cameras": [
            {
                "name": "K1", "columns": [0, 640], "status": "ok", "frame_id": 7, "trigger_count": 9,
                "device_time_ns": "4611686018427387905", "host_time_ns": "1795216434399239001", "offset_us": 1.5,
            },
            {
                "name": "K2", "columns": [640, 1280], "status": "missed", "frame_id": None, "trigger_count": None,
                "device_time_ns": None, "host_time_ns": None, "offset_us": None,
            },
        ],
    }  # fmt: skip


def test_the_schema_refuses_numbers_that_javascript_would_round() -> None:
    tag = TripletTag(PulseNumber(1), UtcNs(5), "", "", (480, 640), (CameraTag("K1", (0, 640), FrameStatus.ABSENT),))
    with pytest.raises(jsonschema.ValidationError):
        VALIDATOR.validate({**wire.to_builtins(tag), "time_ns": 5})


def test_the_schema_refuses_an_unknown_status() -> None:
    tag = TripletTag(PulseNumber(1), UtcNs(5), "", "", (480, 640), (CameraTag("K1", (0, 640), FrameStatus.ABSENT),))
    plain = wire.to_builtins(tag)
    with pytest.raises(jsonschema.ValidationError):
        VALIDATOR.validate({**plain, "cameras": [{**plain["cameras"][0], "status": "gone"}]})


@pytest.mark.parametrize("text", [b"", b"{}", b"[]", b'{"pulse": 1}', b"\xff"])
def test_what_is_no_tag_is_refused(text: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        TripletTag.decode(text)


def test_pixels_of_a_signature_are_marked_only_where_there_are_any() -> None:
    plain = CameraTag("K1", (0, 640), FrameStatus.OK, 1, 1, DeviceNs(5), UtcNs(6), 0.0)
    signed = CameraTag("K2", (640, 1280), FrameStatus.OK, 1, 1, DeviceNs(5), UtcNs(6), 0.0, (479, 640, 12))
    tag = TripletTag(PulseNumber(1), UtcNs(5), "", "", (480, 1280), (plain, signed))
    data = wire.to_builtins(tag)
    VALIDATOR.validate(data)
    assert [camera.get("stamped_pixels") for camera in data["cameras"]] == [None, [479, 640, 12]]
    assert "stamped_pixels" not in data["cameras"][0]
    assert TripletTag.decode(tag.encode()) == tag
