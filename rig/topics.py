"""Names of topics, schemas, metadata and attachments, in the log and on ZeroMQ: the one table of them."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Topic:
    """One channel of the log and the corresponding topic on ZeroMQ.

    Attributes:
        name: name of the channel in the MCAP log.
        schema: name of the message schema.
        encoding: encoding of the messages in the log.
        live: topic on ZeroMQ; None: not published on its own.
    """

    name: str
    schema: str
    encoding: str
    live: str | None


TRIPLET: Final = Topic("/triplet", "foxglove.RawImage", "protobuf", "triplet")
CAMERA_TOPIC: Final = (
    "/camera/"  #: and the camera's name: its image, `foxglove.RawImage`, in place of /triplet on request
)
TAG: Final = Topic("/triplet/tag", "svev.TripletTag", "json", None)
EVENTS: Final = Topic("/events", "foxglove.Log", "protobuf", "event")
HEALTH: Final = Topic("/health", "svev.Health", "json", "health")
JUMPER: Final = Topic("/jumper", "svev.JumperState", "json", "jumper")
JUMPER_SCENE: Final = Topic("/jumper/scene", "foxglove.SceneUpdate", "protobuf", None)
JUMPER_CAMERAS: Final = Topic("/jumper/cameras", "foxglove.FrameTransforms", "protobuf", None)
#: Messages of the recorder that belong to no pulse, and results of the analysis.
NOTES: Final = (EVENTS.name, HEALTH.name)
RESULTS: Final = (JUMPER.name, JUMPER_SCENE.name, JUMPER_CAMERAS.name)

PROFILE: Final = "svev"
SESSION_METADATA: Final = "svev.session"
RIG_METADATA: Final = "svev.rig"
RECORDING_METADATA: Final = "svev.recording"
RECOVERY_METADATA: Final = "svev.recovery"
MERGE_METADATA: Final = "svev.merge"
IMPORT_METADATA: Final = "svev.import"
COMPACT_METADATA: Final = "svev.compact"
#: What went wrong while the log was written, by where it went wrong, e.g. "disk".
TROUBLE_METADATA: Final = "svev.trouble"
RIG_ATTACHMENT: Final = "rig.toml"
CALIBRATION_ATTACHMENT: Final = "calibration.json"
DEFAULT_PUBLISH: Final = "tcp://127.0.0.1:5556"
