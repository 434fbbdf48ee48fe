"""Simulates pulses, device clocks and arrivals for as long as one likes, and passes the records to a pairer.

Everything happens in true time, which nobody in the simulation can read. The host's monotonic clock stands still while
the host is suspended. A device clock drifts, wanders, and is set now and then. What the grabber adds is real: it reads
the clocks when `capture.clock_reading` says so.
"""

import heapq
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, field

from capture.clock_reading import ClockReading
from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from rig.frame import FrameRecord
from triggering.pairing.pairer import ClosedPulse, Pairer

MS = 1_000_000
_DEAD_NS = 3 * MS  #: a camera does not see a pulse so soon after the one before
_WANDER_S = 40.0
_BOOT_S = 3.0
_SUSPENDED_S = 2.0
_ROUND_TRIP_NS = (50_000, 200_000)
_LOADED_NS = (MS, 10 * MS)
#: Nothing goes wrong before: a rig is armed with pulses that are watched and not recorded.
_QUIET_S = 3.0


@dataclass(frozen=True)
class Case:
    """What pulses, clocks and cameras do. Probabilities are per pulse; times are in the unit that the name says.

    Attributes:
        name: for people.
        rates_hz: real rates, each for the same share of the pulses.
        rate_hz: what the rig file says.
        steps_ms: by how much device clocks are set, in turns; `math.inf`: by one period, `-math.inf`: back by one.
        every_s: time between two steps, reboots, suspensions or pauses.
        slips_ms: by how much the times of frames are off from then on, in turns, while the clock that is read goes on.
        at_miss: the camera whose clock is set, or whose times slip, misses the pulse.
        at_loss: the camera's frame at the trouble is lost.
        at_once: how many cameras a trouble concerns at once.
        spikes_ms: by how much the time of a single frame is off, in turns; then it goes on as before.
        stalls_ms: for how long the computer takes no frames; then it takes all at once.
        delays_ms: by how much later frames come from then on, in turns.
        skipped_ids: by how much the numbers of frames go on without any frame, in turns.
        doubled: probability of a second pulse, `double_ms` later; half of them hide the first from some cameras.
    """

    name: str
    rates_hz: tuple[float, ...] = (30.0,)
    rate_hz: float = 30.0
    steps_ms: tuple[float, ...] = ()
    slips_ms: tuple[float, ...] = ()
    at_miss: bool = False
    at_loss: bool = False
    at_once: int = 1
    spikes_ms: tuple[float, ...] = ()
    stalls_ms: tuple[float, ...] = ()
    delays_ms: tuple[float, ...] = ()
    skipped_ids: tuple[int, ...] = ()
    every_s: float = 20.0
    reboots: bool = False
    suspended: bool = False
    pauses: bool = False
    doubled: float = 0.0
    double_ms: float = 1.0
    drift_ppm: tuple[float, float, float] = (0.0, 40.0, -60.0)
    wander_ppm: float = 0.0
    jitter_ms: float = 0.05
    missed: float = 0.01
    lost: float = 0.01
    latency_ms: tuple[float, float] = (5.0, 7.0)
    random_intervals: bool = False


@dataclass
class Result:
    """What came of a case.

    Attributes:
        pulses: that fired.
        possible: of them, all cameras took a frame, and all frames came.
        found: of these, have a complete triplet.
        mixed: decided pulses with frames of different pulses.
        invented: decided pulses that never fired, or whose frames are of a pulse that is decided already.
        alarm: whether the pairing raised an alarm at any time.
    """

    pulses: int = 0
    possible: int = 0
    found: int = 0
    mixed: int = 0
    invented: int = 0
    alarm: bool = False

    @property
    def not_found(self) -> int:
        """Triplets that were possible and are not there."""
        return self.possible - self.found


@dataclass
class _Camera:
    """One camera: its clock, ids and the grabber's reading of the clock."""

    number: int
    case: Case
    rng: random.Random
    offset: int = 0
    slip: int = 0
    spike: int = 0
    delay: float = 0.0
    loses: bool = False
    next_id: int = 1
    busy_until: float = -math.inf
    away_until: float = -math.inf
    last_arrival: float = 0.0
    reading: ClockReading = field(default_factory=ClockReading)

    def device(self, time: float) -> DeviceNs:
        """The clock at a true time."""
        phase = 2 * math.pi * time / (_WANDER_S * NS_PER_S) + self.number
        wander = self.case.wander_ppm * 1e-6 * _WANDER_S * NS_PER_S / (2 * math.pi) * math.sin(phase)
        return DeviceNs(self.offset + round(time * (1 + self.case.drift_ppm[self.number] * 1e-6) + wander))


class Hill:
    """Runs one case.

    Args:
        case: what happens.
        pulses: how many fire.
        seed: of everything that is random.
    """

    def __init__(self, case: Case, pulses: int, seed: int = 1) -> None:
        self._case, self._pulses, self._rng = case, pulses, random.Random(seed)  # noqa: S311
        self._cameras = [_Camera(number, case, self._rng, number * 10**15) for number in range(3)]
        period = round(NS_PER_S / case.rate_hz)
        self._pairer = Pairer(3, period, hold_ns=130 * MS + 4 * period)
        self._arrivals: list[tuple[float, int, int, FrameRecord]] = []
        self._times: dict[int, float] = {}  # true time of the pulses that may still be decided
        self._decided: set[int] = set()
        self._suspensions: list[tuple[float, float]] = []
        self._slept = self._stalled_until = 0.0
        self._next_trouble = max(_QUIET_S, case.every_s) * NS_PER_S
        self._troubles = self._count = 0
        self._held: dict[int, int] = {}
        self.result = Result()

    def run(self) -> Result:
        """Fire all pulses and count what came of them."""
        for camera in self._cameras:
            self._pairer.connected(camera.number, 1, HostNs(0))
            for index in range(16):
                self._latch(camera, index * 0.1 * MS)
        for pulse, time in enumerate(self._fire()):
            self._deliver(until=time)
            self._trouble(time)
            self._expose(pulse, time)
        self._deliver(until=math.inf)
        self._decide(HostNs(1 << 62))
        self.result.pulses = self._pulses
        return self.result

    def _fire(self) -> Iterator[float]:
        """True times of the pulses."""
        case, rng, time = self._case, self._rng, 0.5 * NS_PER_S
        pulse = 0
        while pulse < self._pulses:
            rate = case.rates_hz[min(len(case.rates_hz) - 1, pulse * len(case.rates_hz) // self._pulses)]
            period = NS_PER_S / rate
            time += period * (rng.uniform(0.7, 3.0) if case.random_intervals else 1.0)
            yield time
            pulse += 1
            if rng.random() < case.doubled and time > _QUIET_S * NS_PER_S and pulse < self._pulses:
                yield time + case.double_ms * MS
                pulse += 1
            if case.pauses and time > self._next_trouble:
                time += rng.uniform(0.05, 3.0) * NS_PER_S
                self._next_trouble = time + case.every_s * NS_PER_S

    def _trouble(self, time: float) -> None:
        """Set a clock, reboot a camera, or suspend the host, whichever is due."""
        case = self._case
        if case.pauses or time < self._next_trouble:
            return
        self._next_trouble = time + case.every_s * NS_PER_S
        camera = self._cameras[self._troubles % 3]
        for each in [self._cameras[(self._troubles + more) % 3] for more in range(case.at_once)]:
            each.offset += round(self._turn(case.steps_ms) * MS)
            each.slip += round(self._turn(case.slips_ms) * MS)
            each.spike = round(self._turn(case.spikes_ms) * MS)
            each.next_id = (each.next_id - 1 + round(self._turn(case.skipped_ids))) % 65535 + 1
            if case.at_miss:
                each.busy_until = time + MS
            each.loses = case.at_loss
            each.delay = self._turn(case.delays_ms) * MS
        if case.stalls_ms:
            self._stalled_until = time + self._turn(case.stalls_ms) * MS
        if case.reboots:
            camera.offset -= camera.device(time + _BOOT_S * NS_PER_S)
            camera.next_id, camera.away_until = 1, time + _BOOT_S * NS_PER_S
        if case.suspended:
            self._suspensions.append((time, _SUSPENDED_S * NS_PER_S))
        self._troubles += 1

    def _turn(self, values: tuple[float, ...]) -> float:
        """The value whose turn it is; infinite: one period, ms."""
        value = values[self._troubles // 3 % len(values)] if values else 0.0
        return math.copysign(1000 / self._case.rates_hz[0], value) if math.isinf(value) else value

    def _expose(self, pulse: int, time: float) -> None:
        case, rng, came = self._case, self._rng, 0
        self._times[pulse] = time
        quiet = time < _QUIET_S * NS_PER_S
        hidden = case.doubled and rng.random() < case.doubled
        for camera in self._cameras:
            chance = 1.0 if quiet else rng.random()
            blind = chance < case.missed or (hidden and rng.random() < 0.5)
            if blind or time < camera.busy_until or time < camera.away_until:
                continue
            camera.busy_until = time + _DEAD_NS
            number, camera.next_id = camera.next_id, camera.next_id % 65535 + 1
            if (chance > 1 - case.lost and not quiet) or self._asleep(time) or camera.loses:
                camera.loses = False
                continue
            came += 1
            self._send(camera, pulse, number, time)
        if came == 3:
            self.result.possible += 1

    def _send(self, camera: _Camera, pulse: int, number: int, time: float) -> None:
        case, rng = self._case, self._rng
        latency = rng.uniform(*case.latency_ms) * MS + camera.delay
        arrival = max(camera.last_arrival, time + latency, self._stalled_until)
        camera.last_arrival = arrival
        device = DeviceNs(camera.device(time + rng.random() * case.jitter_ms * MS) + camera.slip + camera.spike)
        camera.spike = 0
        record = FrameRecord(self._host(arrival), pulse, number, 65535, device, epoch=1)
        self._count += 1
        heapq.heappush(self._arrivals, (arrival, self._count, camera.number, record))

    def _asleep(self, time: float) -> bool:
        return any(begin <= time < begin + length for begin, length in self._suspensions[-1:])

    def _host(self, time: float) -> HostNs:
        """The host's monotonic clock at a true time."""
        while len(self._suspensions) > 1:
            self._slept += self._suspensions.pop(0)[1]
        slept = sum(min(length, max(0.0, time - begin)) for begin, length in self._suspensions)
        return HostNs(round(time - self._slept - slept))

    def _deliver(self, until: float) -> None:
        """Pass on the frames that arrive until a true time; the grabber reads a clock after a frame."""
        while self._arrivals and self._arrivals[0][0] <= until:
            arrival, _, number, record = heapq.heappop(self._arrivals)
            self._advance(record.host_time)
            camera = self._cameras[number]
            self._pairer.frame(number, record)
            if camera.reading.is_due(record.host_time, record.device_time):
                self._latch(camera, arrival)
            self._decide(record.host_time)

    def _advance(self, until: HostNs) -> None:
        while (deadline := self._pairer.next_deadline()) is not None and deadline < until:
            self._decide(deadline)

    def _decide(self, now: HostNs) -> None:
        self._pairer.released(now)
        self._check(self._pairer.advance(now))

    def _latch(self, camera: _Camera, time: float) -> None:
        rng = self._rng
        round_trip = rng.randrange(*(_LOADED_NS if rng.random() < 0.03 else _ROUND_TRIP_NS))
        host = HostNs(self._host(time) + round_trip // 2)
        device = camera.device(time + round_trip * rng.random())
        self._pairer.latch(camera.number, ClockLatch(device, host, round_trip))
        camera.reading.done(host)

    def _check(self, closed: list[ClosedPulse]) -> None:
        result = self.result
        for pulse in closed:
            true = {outcome.record.slot for outcome in pulse.outcomes if outcome.record is not None}
            if len(true) > 1:
                result.mixed += 1
            elif true:
                result.found += pulse.complete
                result.invented += bool(true & self._decided)
            else:
                result.invented += not self._fired(pulse.time)
            self._decided |= true
        if closed:
            result.alarm = result.alarm or self._pairer.health().alarm
            if len(self._times) > 2000:
                self._forget()

    def _fired(self, time: HostNs) -> bool:
        """Whether a pulse that nobody delivered fired about then."""
        period = NS_PER_S / max(self._case.rates_hz)
        return any(abs(self._host(true) - time) < period / 3 for true in self._times.values())

    def _forget(self) -> None:
        for pulse in sorted(self._times)[:-1000]:
            del self._times[pulse]
            self._decided.discard(pulse)
