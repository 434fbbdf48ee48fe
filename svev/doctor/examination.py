"""Every probe there is, each with a time limit; a probe that fails is a finding itself."""

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from rig.settings import RigSettings
from svev.doctor import cameras, disk, firewire, machine, memory, network, software
from svev.doctor.finding import Finding, Topic, failure


@dataclass(frozen=True, slots=True)
class Probe:
    """Something to look at.

    Attributes:
        name: for people.
        topic: of its findings.
        look: gives the findings.
        limit_s: a probe that takes longer has failed.
    """

    name: str
    topic: Topic
    look: Callable[[], Iterable[Finding]]
    limit_s: float = 5.0


def probes(rig: RigSettings, directory: Path) -> list[Probe]:
    """Everything that is looked at for `rig` when it records to `directory`, in the order it is shown."""
    return [
        Probe("Python", Topic.SOFTWARE, software.look_at_python),
        Probe("packages", Topic.SOFTWARE, software.look_at_packages, limit_s=30.0),
        Probe("camera libraries", Topic.SOFTWARE, lambda: software.look_at_camera_libraries(rig), limit_s=10.0),
        Probe("memory", Topic.MEMORY, lambda: memory.look_at_memory(rig)),
        Probe("shared memory", Topic.MEMORY, lambda: memory.look_at_shared_memory(rig)),
        Probe("huge pages", Topic.MEMORY, memory.look_at_huge_pages),
        Probe("disk", Topic.DISK, lambda: disk.look_at_disk(rig, directory), limit_s=30.0),
        Probe("packet sockets", Topic.NETWORK, lambda: network.look_at_packet_sockets(rig)),
        Probe("socket buffers", Topic.NETWORK, lambda: network.look_at_socket_buffers(rig)),
        Probe("interfaces", Topic.NETWORK, lambda: network.look_at_interfaces(rig)),
        Probe("publication", Topic.NETWORK, lambda: network.look_at_publication(rig)),
        Probe("cameras", Topic.CAMERAS, lambda: cameras.look_at_cameras(rig), limit_s=5.0 * len(rig.cameras)),
        Probe("FireWire", Topic.CAMERAS, lambda: firewire.look_at_firewire(rig), limit_s=firewire.LOOK_S + 2),
        Probe("discovery", Topic.CAMERAS, lambda: cameras.look_for_cameras(rig), limit_s=10.0),
        Probe("clock", Topic.TIME, machine.look_at_clock),
        Probe("processor", Topic.PROCESSOR, machine.look_at_processor),
    ]


def firewire_probes(rig: RigSettings) -> list[Probe]:
    """The FireWire cameras of a rig alone, and tried."""
    limit_s = firewire.trial_limit_s(rig) + 15
    return [
        Probe("camera libraries", Topic.SOFTWARE, lambda: software.look_at_camera_libraries(rig), limit_s=10.0),
        Probe("FireWire", Topic.CAMERAS, lambda: firewire.try_firewire(rig), limit_s=limit_s),
    ]


def run_probe(probe: Probe) -> list[Finding]:
    """The findings of one probe; never raises, never takes longer than its limit."""
    findings: list[Finding] = []

    def look() -> None:
        try:
            findings.extend(probe.look())
        except Exception as error:  # noqa: BLE001 - whatever stops a probe is what the doctor has found
            reason = f"{type(error).__name__}: {error}"
            findings.append(
                failure(probe.topic, f"{probe.name} cannot be examined: {reason}", "report it with this line")
            )

    # A thread, because some probes hang in the kernel or in a library, where nothing else can interrupt them.
    worker = threading.Thread(target=look, name=f"doctor: {probe.name}", daemon=True)
    worker.start()
    worker.join(probe.limit_s)
    if worker.is_alive():
        what = f"{probe.name} did not answer within {probe.limit_s:g} s"
        return [failure(probe.topic, what, "see whether the disk, network or camera behind it hangs: look at `dmesg`")]
    return findings
