"""Schemas and channels of a log, made from the table of topics."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.records import Channel, Schema
from mcap_protobuf.schema import build_file_descriptor_set

from recorder.log.mcap_layout import (
    EVENTS_CHANNEL,
    FIRST_CALIBRATION_CHANNEL,
    HEALTH_CHANNEL,
    JUMPER_CAMERAS_CHANNEL,
    JUMPER_CHANNEL,
    JUMPER_SCENE_CHANNEL,
    TAG_CHANNEL,
    TRIPLET_CHANNEL,
    SlotImage,
)
from rig.health import HEALTH_SCHEMA
from rig.jumper import JUMPER_SCHEMA
from rig.tag import TAG_SCHEMA
from rig.topics import CAMERA_TOPIC, EVENTS, HEALTH, JUMPER, JUMPER_CAMERAS, JUMPER_SCENE, TAG, TRIPLET, Topic

CALIBRATION_TOPIC = "/calibration/"


def schemas_and_channels(
    calibrated: Iterable[str] = (), images: Sequence[SlotImage] = ()
) -> tuple[list[Schema], list[Channel]]:
    """Everything a log declares before its first message.

    Args:
        calibrated: names of the cameras that get a channel `/calibration/<camera>`.
        images: the image messages of a slot; without them, that of the triplet is declared.
    """
    schemas = [
        _protobuf(1, RawImage),
        _json(2, TAG, TAG_SCHEMA),
        _protobuf(3, Log),
        _json(4, HEALTH, HEALTH_SCHEMA),
        _json(6, JUMPER, JUMPER_SCHEMA),
        _protobuf(7, SceneUpdate),
        _protobuf(8, FrameTransforms),
    ]
    shown = [
        (image.channel, TRIPLET.name if image.channel == TRIPLET_CHANNEL else CAMERA_TOPIC + image.frame)
        for image in images
    ]
    channels = [Channel(id_, name, TRIPLET.encoding, {}, 1) for id_, name in shown or [(TRIPLET_CHANNEL, TRIPLET.name)]]
    channels += [
        Channel(id_, topic.name, topic.encoding, {}, schema)
        for id_, topic, schema in (
            (TAG_CHANNEL, TAG, 2),
            (EVENTS_CHANNEL, EVENTS, 3),
            (HEALTH_CHANNEL, HEALTH, 4),
            (JUMPER_CHANNEL, JUMPER, 6),
            (JUMPER_SCENE_CHANNEL, JUMPER_SCENE, 7),
            (JUMPER_CAMERAS_CHANNEL, JUMPER_CAMERAS, 8),
        )
    ]
    cameras = list(calibrated)
    if cameras:
        schemas.append(_protobuf(5, CameraCalibration))
    channels += [
        Channel(FIRST_CALIBRATION_CHANNEL + place, CALIBRATION_TOPIC + camera, "protobuf", {}, 5)
        for place, camera in enumerate(cameras)
    ]
    return schemas, channels


def _protobuf(id_: int, message: Any) -> Schema:
    data = build_file_descriptor_set(message).SerializeToString()
    return Schema(id=id_, name=message.DESCRIPTOR.full_name, encoding="protobuf", data=data)


def _json(id_: int, topic: Topic, schema: dict[str, object]) -> Schema:
    return Schema(id=id_, name=topic.schema, encoding="jsonschema", data=json.dumps(schema).encode())
