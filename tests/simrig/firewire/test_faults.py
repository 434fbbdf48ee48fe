"""Each fault as the unmodified libdc1394 sees it: mostly not at all, which is why the signature is needed."""

import time
from itertools import pairwise
from typing import Any

import pytest

from rig.clocks import host_now
from rig.errors import BadInputError
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.faults import Fault, FaultKind
from tests.simrig.firewire.conftest import GUIDS, Program, RefusedError, StartHill, StartProgram
from tests.support.waiting import wait_until

AROUND = 3


def receiving(start_hill: StartHill, start_program: StartProgram, ring: int = 64) -> tuple[SimulatedHill, Program]:
    """A hill, and a program that has received from K1."""
    hill = start_hill()
    program = start_program(hill, "K1")
    program("start", ring)
    assert len(program("frames", 1)) == 1
    return hill, program


def befall(
    hill: SimulatedHill, program: Program, around: int = AROUND, **fault: Any
) -> tuple[int, list[dict[str, Any]]]:
    """Let a fault befall K1 soon.

    Returns:
        Its pulse, and the frames received until some pulses later.
    """
    pulse = hill.train.next_index(host_now()) + 30
    hill.inject(Fault(camera="K1", at_pulse=pulse, **fault))
    return pulse, program("frames_until", pulse + around)


def missing(frames: list[dict[str, Any]], pulse: int, around: int = AROUND) -> list[int]:
    """Which of the pulses about `pulse` have no frame."""
    pulses = [frame["pulse"] for frame in frames]
    return [one for one in range(pulse - AROUND, pulse + around + 1) if one not in pulses]


@pytest.mark.parametrize(
    ("kind", "triggers", "frames"),
    [
        (FaultKind.MISSED_PULSE, 0, 0),
        (FaultKind.OVERRUN, 1, 0),
        (FaultKind.LOST_FRAME, 1, 1),
        (FaultKind.LOST_LEADER, 1, 1),
    ],
)
def test_a_frame_that_vanishes(
    start_hill: StartHill, start_program: StartProgram, kind: FaultKind, triggers: int, frames: int
) -> None:
    """The counters tell the causes apart: not triggered; triggered, not read out; read out, not transferred."""
    pulse, seen = befall(*receiving(start_hill, start_program), kind=kind)
    assert missing(seen, pulse) == [pulse]
    before, after = (next(frame for frame in seen if frame["pulse"] == pulse + step) for step in (-1, 1))
    assert after["trigger_count"] - before["trigger_count"] == 1 + triggers
    assert after["frame_count"] - before["frame_count"] == 1 + frames


@pytest.mark.parametrize("packets", [(2,), (120,), (240,), (60, 61, 200)])
def test_a_lost_packet_tears_two_frames(
    start_hill: StartHill, start_program: StartProgram, packets: tuple[int, ...]
) -> None:
    """The frame comes a period late, with the begin of the next one as its end; the next one does not come at all."""
    hill, program = receiving(start_hill, start_program)
    pulse, seen = befall(hill, program, kind=FaultKind.LOST_PACKETS, packets=packets)
    (torn,) = [index for index, frame in enumerate(seen) if frame["pulse"] is None]
    assert seen[torn - 1]["pulse"] == pulse - 1
    assert seen[torn + 1]["pulse"] == pulse + 2
    begun = seen[torn]["timestamp_us"]
    assert begun - seen[torn - 1]["timestamp_us"] == pytest.approx(33_333, abs=8_000), "the time is that of its begin"
    assert seen[torn]["cycle_time"] != seen[torn - 1]["cycle_time"]
    assert seen[torn + 1]["trigger_count"] - seen[torn - 1]["trigger_count"] == 3


def test_a_stalled_consumer_loses_frames_and_comes_back(start_hill: StartHill, start_program: StartProgram) -> None:
    """Eight buffers hold eight frames; the rest vanishes without a word, and then whole frames follow."""
    _, program = receiving(start_hill, start_program, ring=8)
    program("sleep", 0.9)
    seen = program("frames", 30)
    pulses = [frame["pulse"] for frame in seen]
    assert None not in pulses, "none is torn"
    gaps = [two - one - 1 for one, two in pairwise(pulses)]
    assert sum(gap > 0 for gap in gaps) == 1
    assert max(gaps) >= 10
    assert gaps.index(max(gaps)) >= 7, "those in the buffers came first"
    assert seen[-1]["trigger_count"] - seen[0]["trigger_count"] == pulses[-1] - pulses[0]


def test_a_ring_of_64_outlasts_a_second(start_hill: StartHill, start_program: StartProgram) -> None:
    _, program = receiving(start_hill, start_program)
    program("sleep", 1.0)
    pulses = [frame["pulse"] for frame in program("frames", 45)]
    assert pulses == list(range(pulses[0], pulses[0] + 45))


def test_a_bus_reset_loses_nothing(start_hill: StartHill, start_program: StartProgram) -> None:
    hill, program = receiving(start_hill, start_program)
    generation = hill.bus_state().generation
    pulse, seen = befall(hill, program, kind=FaultKind.BUS_RESET)
    assert missing(seen, pulse) == []
    hill.reset_bus()
    assert hill.bus_state().generation == generation + 2
    assert program("advanced", 0x624) > 20, "registers answer by the new generation"
    program("call", "reset_bus")
    assert hill.bus_state().generation == generation + 3
    assert len(program("frames", 5)) == 5


def test_unplugged_and_back(start_hill: StartHill, start_program: StartProgram) -> None:
    hill = start_hill(2)
    program, other = start_program(hill, "K1"), start_program(hill, "K2")
    program("start", 32)
    other("start", 32)
    assert len(program("frames", 3)) == len(other("frames", 3)) == 3
    hill.kill("K1")
    assert hill.bus_state().nodes == ("fw0", "fw2")
    assert list(hill.pids) == ["K2"]
    began = time.monotonic()
    with pytest.raises(RefusedError):
        program("frames", 30)
    assert time.monotonic() - began < 5, "a camera that is gone is told at once"
    with pytest.raises(RefusedError):
        program("get", "feature_get_value", 423)
    program.close()
    assert hill.bus_state().channels == (1,)
    hill.restart("K1")
    assert hill.bus_state().nodes == ("fw0", "fw2", "fw1")
    again = start_program(hill)
    assert sorted(again("cameras")) == [GUIDS["K1"], GUIDS["K2"]]
    again("open", GUIDS["K1"])
    assert again("get", "external_trigger_get_power") == 0, "it has its defaults"
    again("configure")
    again("start")
    assert len(again("frames", 5)) == 5
    pulses = [frame["pulse"] for frame in other("frames", 60, 0.2)]
    assert pulses[:32] == list(range(pulses[0], pulses[0] + 32)), "the other camera went on"


def test_unplugging_that_the_scenario_plans(start_hill: StartHill, start_program: StartProgram) -> None:
    hill = start_hill(toml='[[faults]]\nkind = "restart"\ncamera = "K1"\nat_pulse = 120\nduration_s = 0.3\n')
    assert hill.bus_state().nodes == ("fw0", "fw1")
    start_program(hill, "K1")
    wait_until(lambda: hill.bus_state().nodes == ("fw0",), "unplugged")
    wait_until(lambda: hill.bus_state().nodes == ("fw0", "fw1"), "plugged in again")


def test_a_frozen_camera_misses_pulses(start_hill: StartHill, start_program: StartProgram) -> None:
    hill, program = receiving(start_hill, start_program)
    _, seen = befall(hill, program, 40, kind=FaultKind.FROZEN, duration_s=0.5)
    before, after = max(pairwise(seen), key=lambda pair: pair[1]["pulse"] - pair[0]["pulse"])
    gone = after["pulse"] - before["pulse"] - 1
    assert gone >= 8
    assert after["trigger_count"] - before["trigger_count"] <= 3, "not even counted"
    assert hill.statistics()["K1"].missed >= gone - 2


@pytest.mark.parametrize("fault", [{"kind": "damaged_frame"}, {"kind": "slow_link", "duration_s": 1.0, "mbit_s": 1.0}])
def test_faults_that_firewire_does_not_have(start_hill: StartHill, fault: dict[str, Any]) -> None:
    with pytest.raises(BadInputError, match="cannot befall camera K1 on its bus; give one of bus_reset, frozen"):
        start_hill().inject(Fault(camera="K1", **fault))


def test_faults_of_the_past_and_of_strangers(start_hill: StartHill, start_program: StartProgram) -> None:
    hill, program = receiving(start_hill, start_program)
    pulse = program("frames", 1)[0]["pulse"]
    with pytest.raises(BadInputError, match="is past"):
        hill.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K1", at_pulse=pulse))
    with pytest.raises(BadInputError, match='no camera "K9"'):
        hill.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K9"))
