"""The list of all probes of the doctor, and how one is run: within a time limit, its failure being a finding."""

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from rig.settings.model import RigSettings
from svev.doctor import disk, gpio, machine, named_files, network, object_store, trigger_box, webhook
from svev.doctor.cameras import exposure, firewire, gige
from svev.doctor.finding import Finding, Topic, failure


@dataclass(frozen=True, slots=True)
class Probe:
    """One examination.

    Attributes:
        name: what is examined, for people.
        topic: topic of the finding if the probe itself fails.
        look: examines and gives the findings.
        limit_s: time limit, s; a probe that takes longer has failed.
    """

    name: str
    topic: Topic
    look: Callable[[], Iterable[Finding]]
    limit_s: float = 5.0


def probes(rig: RigSettings, directory: Path, interrupted: bool | None = None) -> list[Probe]:
    """All probes for a rig that records into `directory`, in the order in which findings are shown.

    Args:
        rig: the rig.
        directory: of the recordings.
        interrupted: whether the beam of the light barrier is, as this process sees that has its line; None: the line
            is to be asked.
    """
    return [
        Probe("Python", Topic.SOFTWARE, machine.look_at_python),
        Probe("packages", Topic.SOFTWARE, machine.look_at_packages, limit_s=30.0),
        Probe("camera libraries", Topic.SOFTWARE, lambda: machine.look_at_camera_libraries(rig), limit_s=10.0),
        Probe("survey", Topic.SOFTWARE, lambda: named_files.look_at_survey(rig), limit_s=30.0),
        Probe("calibration", Topic.SOFTWARE, lambda: named_files.look_at_calibration(rig), limit_s=30.0),
        Probe("plan", Topic.SOFTWARE, lambda: named_files.look_at_plan(rig), limit_s=30.0),
        Probe("scenario", Topic.SOFTWARE, lambda: named_files.look_at_scenario(rig), limit_s=30.0),
        Probe("memory", Topic.MEMORY, lambda: machine.look_at_memory(rig)),
        Probe("shared memory", Topic.MEMORY, lambda: machine.look_at_shared_memory(rig)),
        Probe("huge pages", Topic.MEMORY, machine.look_at_huge_pages),
        Probe("disk", Topic.DISK, lambda: disk.look_at_disk(rig, directory), limit_s=30.0),
        Probe("other disks", Topic.DISK, lambda: disk.look_at_other_disks(rig, directory)),
        Probe("object store", Topic.DISK, lambda: object_store.look_at_store(rig), limit_s=object_store.LOOK_S + 5),
        Probe("packet sockets", Topic.NETWORK, lambda: network.look_at_packet_sockets(rig)),
        Probe("socket buffers", Topic.NETWORK, lambda: network.look_at_socket_buffers(rig)),
        Probe("interfaces", Topic.NETWORK, lambda: network.look_at_interfaces(rig)),
        Probe("publication", Topic.NETWORK, lambda: network.look_at_publication(rig)),
        Probe("webhook", Topic.NETWORK, lambda: webhook.look_at_webhook(rig), limit_s=webhook.LOOK_S + 2),
        Probe("cameras", Topic.CAMERAS, lambda: gige.look_at_cameras(rig), limit_s=gige.look_limit_s(rig)),
        Probe("exposure", Topic.CAMERAS, lambda: exposure.look_at_exposures(rig)),
        Probe("FireWire", Topic.CAMERAS, lambda: firewire.look_at_firewire(rig), limit_s=firewire.LOOK_S + 2),
        Probe("trigger box", Topic.CAMERAS, lambda: trigger_box.look_at_trigger_box(rig)),
        Probe("trigger line", Topic.CAMERAS, lambda: gpio.look_at_gpio(rig)),
        Probe("light barrier", Topic.CAMERAS, lambda: gpio.look_at_barrier(rig, interrupted)),
        Probe("discovery", Topic.CAMERAS, lambda: gige.look_for_cameras(rig), limit_s=10.0),
        Probe("clock", Topic.TIME, lambda: machine.look_at_clock(_dated_files(rig, directory))),
        Probe("processor", Topic.PROCESSOR, machine.look_at_processor),
    ]


def _dated_files(rig: RigSettings, directory: Path) -> list[Path]:
    """Files that were written before now, by which the clock is judged."""
    analysis = rig.analysis
    named = (rig.calibration, rig.plan, *(() if analysis is None else (analysis.survey, analysis.calibration)))
    return [*directory.glob("*.mcap"), *(file for file in named if file is not None)]


def firewire_probes(rig: RigSettings) -> list[Probe]:
    """The probes of `svev doctor --bus firewire`, which sets up each FireWire camera and takes frames."""
    limit_s = firewire.trial_limit_s(rig) + 15
    return [
        Probe("camera libraries", Topic.SOFTWARE, lambda: machine.look_at_camera_libraries(rig), limit_s=10.0),
        Probe("FireWire", Topic.CAMERAS, lambda: firewire.try_firewire(rig), limit_s=limit_s),
    ]


def run_probe(probe: Probe) -> list[Finding]:
    """Run one probe; never raises, never takes longer than the limit of the probe."""
    findings: list[Finding] = []

    def look() -> None:
        try:
            findings.extend(probe.look())
        except Exception as error:  # noqa: BLE001 - whatever stops a probe is a finding
            reason = f"{type(error).__name__}: {error}"
            what = "{probe} cannot be examined: {why}"
            remedy = "report it with this line"
            findings.append(failure(probe.topic, "check_broken", what, remedy, probe=probe.name, why=reason))

    # In a thread, because a probe may hang in the kernel or in a library, where nothing can interrupt it.
    worker = threading.Thread(target=look, name=f"doctor: {probe.name}", daemon=True)
    worker.start()
    worker.join(probe.limit_s)
    if worker.is_alive():
        what = "{probe} did not answer within {seconds:g} s"
        remedy = "see whether the disk, network or camera behind it hangs: look at `dmesg`"
        return [failure(probe.topic, "check_hangs", what, remedy, probe=probe.name, seconds=probe.limit_s)]
    return findings
