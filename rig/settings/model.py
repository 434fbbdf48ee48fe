"""The settings of a rig: cameras from left to right, trigger, recorder, network, simulation.

`rig.settings.file` reads them from a rig file. The field descriptions stand in the JSON schema (`svev schema`).
"""

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from rig.images.pixels import Pixels
from rig.settings.camera import COMMANDED, CameraSettings, Region
from rig.settings.store_options import StoreOptions
from rig.settings.strict_toml import StrictModel
from rig.settings.trigger import (
    ActionTrigger,
    BarrierSettings,
    ExternalTrigger,
    IidcBroadcastTrigger,
    SoftwareTrigger,
    Trigger,
    check_takes_actions,
)
from rig.settings.webhook import WebhookSettings
from rig.topics import DEFAULT_PUBLISH

#: Processes and events that are not of one camera go by these names, beside those that go by a camera's.
_TAKEN: Final = frozenset({"recorder", "analysis", "trigger", "pairing", "service"})
#: Less than a chunk of a log holds (`recorder.log.mcap_layout.CHUNK_MAX`), with room for the tag.
_TRIPLET_BYTES_MAX: Final = 255 << 20


class RecorderSettings(StrictModel):
    """Where recordings are written and how much is buffered on the way."""

    directory: Path = Field(
        Path("recordings"),
        description="folder of the recordings, relative to the working directory; --data or --out goes before",
    )
    fallback_directory: Path | None = Field(
        None,
        description="folder on another disk, relative to the working directory: a recording whose disk fails, hangs or "
        "is full goes on there",
    )
    ring_s: float = Field(2.0, gt=0, le=60, description="each camera's ring in shared memory, seconds of frames")
    triplets_s: float = Field(2.0, gt=0, le=60, description="triplets waiting for the disk, seconds")
    preroll_s: float = Field(
        5.0,
        ge=0,
        le=600,
        description="svev serve: seconds held in memory while armed, to record the past",
    )
    preroll_limit_mb: float = Field(1024.0, ge=0, description="memory for that at most, 10^6 bytes")
    jump_s: float = Field(10.0, gt=0, le=3600, description="length of a jump, for how many more fit on the disk")
    longest_s: float = Field(
        120.0,
        gt=0,
        le=86400,
        description="svev serve: a recording that was started without a length and that nobody stops ends after so "
        "many seconds",
    )
    part_s: float | None = Field(
        None, ge=1, description="a recording goes on in another log, its next part, after so many seconds"
    )
    part_gb: float | None = Field(
        None, ge=0.001, description="the same before a log is larger than this, 10^9 bytes; both: whichever comes first"
    )
    reserve_gb: float = Field(1.0, ge=0, description="recording stops, file intact, before less than this is free")
    per_camera_topics: bool = Field(
        False,
        description="logs hold an image of each camera on /camera/NAME, with which Foxglove shows its "
        "/calibration/NAME, in place of /triplet",
    )


#: "auto", "keep", or microseconds.
PacketDelay = Literal["auto", "keep"] | Annotated[float, Field(ge=0, le=1_000_000)]


class NetworkSettings(StrictModel):
    """How frames are received and triplets published."""

    publish: str = Field(DEFAULT_PUBLISH, pattern=r"^(tcp|ipc)://.+", description="ZeroMQ PUB address")
    publish_ipc: str | None = Field(
        None, pattern=r"^ipc://.+", description="a second ZeroMQ address, for workers on this machine"
    )
    curve_key_file: Path | None = Field(
        None,
        description="secret keys of the publisher (svev keys makes them), relative to the rig file: only subscribers "
        "that have the public key are served",
    )
    packet_size: int = Field(
        9000,
        ge=576,
        le=65500,
        description="GigE Vision packet size in bytes, IP header included; at most the MTU",
    )
    packet_delay: PacketDelay = Field(
        "auto",
        description="GigE Vision: time that a camera leaves between its packets. auto: enough for the other cameras at "
        "the same port of this computer; keep: as another program has left it; a number: microseconds",
    )
    packet_socket: Literal["auto", "off"] = Field(
        "auto",
        description="auto: receive through a packet socket where permitted (CAP_NET_RAW) and the camera is fast or "
        "net.core.rmem_max small; off: always through plain sockets",
    )
    resend: bool = Field(True, description="ask the camera again for lost packets")


class ServiceSettings(StrictModel):
    """What the service does by itself."""

    arm_at_start: bool = Field(False, description="arm when the service starts, also after a power cut")
    share_hours: float = Field(
        24.0, gt=0, le=720, description="so long the QR code of a jump opens it on a phone without a token"
    )
    coach_delay_s: float = Field(
        8.0,
        ge=0,
        le=60,
        description="delay of the live picture on the coach's screen, so that a jump can be seen again",
    )
    webhook: WebhookSettings | None = Field(None, description="notifications for people who are elsewhere")


class MotionSettings(StrictModel):
    """Where a jumper who comes into sight is noticed."""

    camera: str = Field(min_length=1, max_length=40, description="name of the camera whose images are watched")
    region: Region | None = Field(
        None,
        description="part of its image, in px of the frames, e.g. where the jumper leaves the table; left out: all",
    )
    least_share: float = Field(
        0.004, gt=0, le=0.5, description="share of the region that a jumper covers at least; snow flakes are smaller"
    )


class AutomaticSettings(StrictModel):
    """Recordings that begin by themselves: at a mark (POST /api/mark), or when something moves."""

    before_s: float = Field(4.0, ge=0, le=600, description="seconds before the mark, as far as they are held in memory")
    after_s: float = Field(8.0, gt=0, le=3600, description="seconds after it")
    motion: MotionSettings | None = Field(None, description="watch a camera's images for the jumper")
    barrier: BarrierSettings | None = Field(None, description="a light barrier on a GPIO line of this computer")


class AnalysisSettings(StrictModel):
    """The analysis that measures the jumper, live and in every log; it needs either the survey or the poses."""

    survey: Path | None = Field(
        None, description="survey of the balls and interior orientations (svev-network/1), relative to the rig file"
    )
    calibration: Path | None = Field(
        None, description="poses of the cameras (result of svev orient), relative to the rig file"
    )
    after_recording: tuple[Literal["measure", "video"], ...] = Field(
        ("measure",),
        description="what is done with every log by itself after its end: measure, then video (MP4 with the stick "
        "figure); [] for nothing",
    )

    @model_validator(mode="after")
    def _steps_fit_together(self) -> "AnalysisSettings":
        steps = self.after_recording
        if steps and "measure" not in steps:
            raise ValueError(f"after_recording: {steps[0]} comes after measure: write measure too")
        if len(set(steps)) < len(steps):
            raise ValueError("after_recording: a step stands twice: write it once")
        return self

    @model_validator(mode="after")
    def _one_source(self) -> "AnalysisSettings":
        if (self.survey is None) == (self.calibration is None):
            raise ValueError("analysis needs the survey of the balls or the poses of the cameras: give one of them")
        return self


class OffloadSettings(StrictModel):
    """Copies of all recordings on another disk or in an object store, made when nothing is recorded."""

    to: Path | None = Field(
        None,
        description="folder on another disk, a USB stick or a share that every recording is copied to with all that "
        "belongs to it, relative to the working directory",
    )
    store: str | None = Field(
        None,
        pattern=r"^[a-z][a-z0-9]*://.+",
        description="in place of `to`: where in an object store, for example s3://bucket/jumps; fsspec and its package "
        "for such addresses (s3fs, gcsfs) reach it, with the keys that these find in the environment",
    )
    store_options: StoreOptions = Field(
        {}, description="options of that package, for example endpoint_url; no keys: the rig file stands in every log"
    )
    keep_days: float | None = Field(
        None,
        gt=0,
        description="recordings that are older go into the trash when they are safe in that folder; nothing is deleted "
        "without a rule",
    )
    keep_free_GB: float | None = Field(  # noqa: N815 - a unit
        None,
        gt=0,
        description="the oldest recordings that are safe in that folder go into the trash while less than this is free "
        "here, 10^9 bytes; what lies in the trash counts as free",
    )

    @model_validator(mode="after")
    def _one_place(self) -> "OffloadSettings":
        if (self.to is None) == (self.store is None):
            raise ValueError("set either to, a folder, or store, an address in an object store")
        if self.store is not None and self.store.startswith(("file:", "local:", "memory:")):
            raise ValueError(f"{self.store} is in no object store: set to, a folder")
        return self

    @property
    def place(self) -> str:
        """Where the copies are."""
        return self.store or str(self.to)

    @property
    def releases(self) -> bool:
        """Whether any rule lets recordings go."""
        return self.keep_days is not None or self.keep_free_GB is not None


class SimulationSettings(StrictModel):
    """Simulated cameras instead of real ones, for tests and demonstrations."""

    scenario: Path = Field(description="scenario file of the simulated hill, relative to the rig file")


class RigSettings(StrictModel):
    """One rig: everything that a recording needs to know."""

    name: str = Field(min_length=1, max_length=80, description="of the rig, for people; stands in every log")
    cameras: Annotated[tuple[CameraSettings, ...], Field(min_length=1, max_length=8)] = Field(
        description="from left to right, as their frames stand in the triplet"
    )
    trigger: Trigger = Field(ExternalTrigger(), description="who makes the pulses")
    recorder: RecorderSettings = Field(RecorderSettings(), description="where recordings go, and what is buffered")
    network: NetworkSettings = Field(NetworkSettings(), description="how frames are received and triplets published")
    service: ServiceSettings = Field(ServiceSettings(), description="what the service does by itself")
    analysis: AnalysisSettings | None = Field(None, description="measures the jumper, live and in every log")
    offload: OffloadSettings | None = Field(None, description="copies every recording to another disk")
    automatic: AutomaticSettings = Field(AutomaticSettings(), description="recordings that begin by themselves")
    simulation: SimulationSettings | None = Field(None, description="simulated cameras instead of real ones")
    calibration: Path | None = Field(
        None,
        description="result file of svev calibrate or svev orient, relative to the rig file: its cameras' interior "
        "orientations are written into every log",
    )
    plan: Path | None = Field(
        None,
        description="planned network of svev plan, relative to the rig file: before the cameras are oriented its "
        "stations and directions say where the page shows the balls",
    )

    @model_validator(mode="after")
    def _cameras_fit_together(self) -> "RigSettings":
        names = [camera.name for camera in self.cameras]
        if taken := {name for name in names if name.lower() in _TAKEN}:
            raise ValueError(f"{', '.join(sorted(taken))} is the name of a part of Svev: give the camera another name")
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"camera name {', '.join(sorted(twice))} is used twice: give each camera its own name")
        own = [camera for camera in self.cameras if camera.address and camera.backend != "replay"]
        addresses = [(camera.backend, camera.address.lower().removeprefix("0x")) for camera in own]
        if doubled := {address for address in addresses if addresses.count(address) > 1}:
            raise ValueError(
                f"address {', '.join(a for _, a in sorted(doubled))} is used twice: give each camera its own address"
            )
        stored = {camera.format.pixels: camera for camera in self.cameras}
        if len(stored) > 1:
            given = ", ".join(f"{camera.name} {camera.pixel_format}" for camera in stored.values())
            raise ValueError(
                f"cameras differ in pixel_format ({given}): one image holds all frames of a pulse, so choose formats "
                "with the same number of bits and the same colours"
            )
        if self.simulation is None and any(camera.backend == "sim" for camera in self.cameras):
            raise ValueError('backend "sim" needs a [simulation] table: add scenario = "../scenarios/training.toml"')
        return self

    @model_validator(mode="after")
    def _so_many_cameras_exist(self) -> "RigSettings":
        least, cameras = self.trigger.min_cameras, len(self.cameras)
        if least is not None and least > cameras:
            raise ValueError(
                f"trigger.min_cameras = {least}, but the rig has {cameras} cameras: make it {cameras} or less, or "
                "leave it out"
            )
        return self

    @model_validator(mode="after")
    def _cameras_take_commands(self) -> "RigSettings":
        if isinstance(self.trigger, ActionTrigger):
            for camera in self.cameras:
                check_takes_actions(camera.name, camera.backend, camera.address)
        told = isinstance(self.trigger, SoftwareTrigger | IidcBroadcastTrigger)
        for camera in self.cameras if told else ():
            if isinstance(self.trigger, IidcBroadcastTrigger) and camera.backend != "iidc":
                raise ValueError(
                    f'trigger.source "iidc-broadcast" is a command to FireWire cameras, and {camera.name} has backend '
                    f'"{camera.backend}": use source = "external"'
                )
            if camera.backend not in COMMANDED:
                raise ValueError(
                    f'trigger.source "software" is a command to each camera, and {camera.name} with backend '
                    f'"{camera.backend}" takes none: use source = "external"'
                )
            if camera.iidc.trigger_mode == 1:
                raise ValueError(
                    f"iidc.trigger_mode = 1 of {camera.name} exposes for as long as the pulse lasts, and a command "
                    "has no length: use trigger_mode = 0"
                )
        return self

    @model_validator(mode="after")
    def _motion_is_watched_in_an_image(self) -> "RigSettings":
        motion = self.automatic.motion
        if motion is None:
            return self
        camera = next((camera for camera in self.cameras if camera.name == motion.camera), None)
        if camera is None:
            names = ", ".join(camera.name for camera in self.cameras)
            raise ValueError(f'automatic.motion watches camera "{motion.camera}", which the rig does not have: {names}')
        part, whole = motion.region, camera.region
        if part is not None and (part.x + part.width > whole.width or part.y + part.height > whole.height):
            raise ValueError(
                f"automatic.motion.region reaches beyond the frames of {camera.name}, {whole.width} x {whole.height} "
                "px: its x and y count from the frame's first column and row"
            )
        return self

    @model_validator(mode="after")
    def _triplets_fit_into_a_log(self) -> "RigSettings":
        rows, columns = self.triplet_shape
        if self.triplet_bytes > _TRIPLET_BYTES_MAX:
            raise ValueError(
                f"a triplet of {columns} x {rows} px: a log takes 256 MB per pulse at most; make the cameras' regions "
                "smaller"
            )
        return self

    @model_validator(mode="after")
    def _replayed_cameras_share_a_log(self) -> "RigSettings":
        replayed = [camera for camera in self.cameras if camera.backend == "replay"]
        if replayed and len(replayed) < len(self.cameras):
            other = next(camera for camera in self.cameras if camera.backend != "replay")
            raise ValueError(
                f'camera {other.name} has backend "{other.backend}", {replayed[0].name} "replay": pulses of a log are '
                'not those of other cameras; use backend "replay" for all cameras or for none'
            )
        if len({camera.address for camera in replayed}) > 1:
            raise ValueError(
                "replayed cameras have different logs, whose pulses have nothing to do with each other: "
                "give all cameras the same address"
            )
        return self

    @property
    def least_cameras(self) -> int:
        """With fewer cameras than this the rig is not armed."""
        return len(self.cameras) if self.trigger.min_cameras is None else self.trigger.min_cameras

    def without_absent(self) -> "RigSettings":
        """The same rig, content with any camera that answers."""
        return self.model_copy(update={"trigger": self.trigger.model_copy(update={"min_cameras": 1})})

    def split(self, part_s: float | None, part_gb: float | None) -> "RigSettings":
        """The same rig with other limits for the parts of a recording; None: as they are."""
        limits = {name: limit for name, limit in (("part_s", part_s), ("part_gb", part_gb)) if limit is not None}
        return self.model_copy(update={"recorder": self.recorder.model_copy(update=limits)})

    @property
    def triplet_shape(self) -> tuple[int, int]:
        """Rows and columns of the triplet: the frames side by side (paper, Fig. 3), as high as the highest of them."""
        heights = (camera.region.height for camera in self.cameras)
        return max(heights), sum(camera.region.width for camera in self.cameras)

    @property
    def triplet_bytes(self) -> int:
        """Bytes of a triplet's pixels."""
        rows, columns = self.triplet_shape
        return rows * columns * self.pixels.size

    @property
    def pixels(self) -> Pixels:
        """How triplets hold their pixels."""
        return self.cameras[0].format.pixels

    def own_topics(self) -> tuple[tuple[str, tuple[int, int]], ...]:
        """Name and columns of each camera whose images have a topic of their own; none if triplets have one."""
        names = (camera.name for camera in self.cameras)
        return tuple(zip(names, self.columns(), strict=True)) if self.recorder.per_camera_topics else ()

    def columns(self) -> tuple[tuple[int, int], ...]:
        """For each camera: first column and one past the last column of its block."""
        blocks, first = [], 0
        for camera in self.cameras:
            blocks.append((first, first + camera.region.width))
            first += camera.region.width
        return tuple(blocks)
