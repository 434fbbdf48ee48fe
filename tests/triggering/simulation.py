"""Simulates pulses, cameras with their own clocks, transport and faults, in memory, and keeps the truth.

Every frame's `slot` is a key into the truth, which the pairing never reads.
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass, field

from capture.clock_reading import ClockReading
from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from rig.frame import ConnectedRecord, DamagedRecord, DisconnectedRecord, FrameRecord, FrameStatus, LatchRecord, Record
from triggering.pairing.pairer import ClosedPulse, OpenPulse, Pairer

MS = 1_000_000
US = 1_000


@dataclass(frozen=True)
class Outage:
    """A camera is away: it sees no pulse from `begin_s` to `end_s` after the start.

    Attributes:
        told_after_s: when the disconnection is reported, seconds after its begin; None: never, the camera just
            falls silent and goes on later with the same clock and ids.
    """

    camera: int
    begin_s: float
    end_s: float
    told_after_s: float | None


@dataclass(frozen=True)
class Scenario:
    """What goes wrong, and how often. Times are in ns unless the name says otherwise."""

    seed: int = 0
    cameras: int = 3
    pulses: int = 300
    rate_hz: float = 30.0
    rate_error: float = 0.0
    jitter_ns: int = 0
    drift_ppm: tuple[float, ...] = (0.0, 40.0, -60.0)
    missed: float = 0.0
    lost: float = 0.0
    damaged: float = 0.0
    pauses: dict[int, float] = field(default_factory=dict)  # pulse -> seconds before it
    faults: dict[tuple[int, int], FrameStatus] = field(
        default_factory=dict
    )  # (pulse, camera) -> what becomes of the frame
    outages: tuple[Outage, ...] = ()
    first_id: int = 1
    modulus: int = 65535
    latency_ns: tuple[int, int] = (5 * MS, 45 * MS)
    retention_ns: int = 25 * MS
    bursts: dict[tuple[int, int], int] = field(
        default_factory=dict
    )  # (pulse, camera) -> by how much later that frame comes, ns; those behind it come at once with it
    latch_every_s: float | None = (
        2.0  # beside the readings after frames that come out of turn; None: no readings at all
    )
    loaded_latches: float = 0.3
    trigger_counts: bool = False
    damage_tells_time: bool = False  # as on FireWire: a damaged frame has an approximate trigger time
    batch_ns: int = 0  # the recorder wakes at this interval and then reads camera after camera
    hold_periods: float = 3.0
    exposures_ns: tuple[int, ...] = ()  # a camera's frames come after its exposure and `latency_ns`
    note_the_end: tuple[int, ...] = ()  # cameras whose time of a frame is that of the end of its exposure

    @property
    def period_ns(self) -> int:
        """Nominal period."""
        return round(NS_PER_S / self.rate_hz)

    @property
    def hold_ns(self) -> int:
        """How long a pulse waits for its frames."""
        return round(self.hold_periods * self.period_ns) + 60 * MS


@dataclass
class Hill:
    """The truth of a scenario, and the records that follow from it.

    Attributes:
        times: time of each pulse.
        fates: per pulse and camera, what really became of it.
        pulse_of: slot of a record -> pulse.
        events: (arrival, camera, record) in the order of arrival, in each camera's order too.
    """

    scenario: Scenario
    times: list[HostNs] = field(default_factory=list)
    fates: list[list[FrameStatus]] = field(default_factory=list)
    pulse_of: dict[int, int] = field(default_factory=dict)
    events: list[tuple[HostNs, int, Record]] = field(default_factory=list)

    def __post_init__(self) -> None:
        scenario = self.scenario
        rng = random.Random(scenario.seed)
        self.start = HostNs(rng.randrange(1, 10**15))
        self.times = list(_pulse_times(scenario, self.start, rng))
        self.fates = [[FrameStatus.OK] * scenario.cameras for _ in self.times]
        for camera in range(scenario.cameras):
            self.events += _Camera(self, camera, rng).run()
        self.events.sort(key=lambda event: event[0])  # stable: each camera's order stays


def _pulse_times(scenario: Scenario, start: HostNs, rng: random.Random) -> Iterator[HostNs]:
    period = NS_PER_S / scenario.rate_hz * (1 + scenario.rate_error)
    time = start + 0.2 * NS_PER_S + rng.random() * period
    for pulse in range(scenario.pulses):
        time += scenario.pauses.get(pulse, 0.0) * NS_PER_S
        yield HostNs(round(time))
        time += period


class _Torn(DamagedRecord, frozen=True):
    """A damaged frame whose `slot` is a key into the truth, as that of a whole one."""

    slot: int = 0


class _Camera:
    """Makes the records of one camera."""

    def __init__(self, hill: Hill, camera: int, rng: random.Random) -> None:
        self.hill, self.camera, self.rng = hill, camera, rng
        self.scenario = hill.scenario
        self.rate = 1 + self.scenario.drift_ppm[camera % len(self.scenario.drift_ppm)] * 1e-6
        self.link_rng = random.Random(self.scenario.seed + camera)  # readings after frames change nothing else
        self.epoch = 0
        self.records: list[tuple[HostNs, int, Record]] = []

    def run(self) -> list[tuple[HostNs, int, Record]]:
        scenario, start = self.scenario, self.hill.start
        self.outages = sorted(
            (o for o in scenario.outages if o.camera == self.camera), key=lambda outage: outage.begin_s
        )
        self.connect(start)
        pending = list(self.outages)
        for pulse, time in enumerate(self.hill.times):
            while pending and time >= start + pending[0].end_s * NS_PER_S:
                self.back(pending.pop(0))
            outage = pending[0] if pending and time >= start + pending[0].begin_s * NS_PER_S else None
            self.see(pulse, time, outage)
        for outage in pending:
            self.back(outage)
        if self.scenario.latch_every_s is not None:  # a grabber goes on reading the clock when the pulses have ended
            self.latch_burst(HostNs(self.last_arrival + NS_PER_S // 4), 1, self.link_rng)
        return sorted(self.records, key=lambda entry: entry[0])  # clock readings between the frames

    def connect(self, host: HostNs) -> None:
        self.epoch += 1
        self.offset = self.rng.choice([0, self.rng.randrange(10**12), self.rng.randrange(10**17)])
        self.zero = self.last_arrival = host
        self.next_id = self.scenario.first_id if self.epoch == 1 else 1
        self.triggers = 0
        self.put(host, ConnectedRecord(host, epoch=self.epoch))
        self.latch_burst(HostNs(host + MS), 16, self.rng)
        self.next_burst = host + (self.scenario.latch_every_s or 1e9) * NS_PER_S
        self.reading = ClockReading()

    def back(self, outage: Outage) -> None:
        if outage.told_after_s is None:
            return
        begin = self.hill.start + outage.begin_s * NS_PER_S
        told = HostNs(round(begin + outage.told_after_s * NS_PER_S))
        for _, _, record in self.records:
            if (
                isinstance(record, FrameRecord | _Torn)
                and record.host_time > begin
                and record.slot in self.hill.pulse_of
            ):
                # Frames on the way are lost with the camera.
                self.hill.fates[self.hill.pulse_of.pop(record.slot)][self.camera] = FrameStatus.ABSENT
        self.records = [entry for entry in self.records if entry[0] <= begin]
        self.put(told, DisconnectedRecord(told, epoch=self.epoch))
        self.connect(HostNs(round(self.hill.start + outage.end_s * NS_PER_S)))

    def device(self, host: float) -> DeviceNs:
        return DeviceNs(self.offset + round((host - self.zero) * self.rate))

    def latch_burst(self, host: HostNs, count: int, rng: random.Random) -> None:
        for index in range(count):
            loaded = index > 0 and rng.random() < self.scenario.loaded_latches
            round_trip = rng.randrange(1 * MS, 10 * MS) if loaded else rng.randrange(50 * US, 200 * US)
            time = HostNs(host + index * 100 * US)
            read_at = time + rng.uniform(-0.5, 0.5) * round_trip
            device = self.device(read_at)
            self.put(time, LatchRecord(ClockLatch(device, time, round_trip), self.epoch))

    def see(self, pulse: int, time: HostNs, outage: Outage | None) -> None:
        scenario, fates = self.scenario, self.hill.fates[pulse]
        if outage is not None:
            fates[self.camera] = FrameStatus.MISSED if outage.told_after_s is None else FrameStatus.ABSENT
            return
        if scenario.latch_every_s is not None and time > (idle := HostNs(self.last_arrival + NS_PER_S // 4)):
            self.latch_burst(idle, 1, self.link_rng)  # a grabber reads the clock while no pulses come
            self.reading.done(idle)
        while time > self.next_burst:
            self.latch_burst(HostNs(round(self.next_burst)), 8, self.rng)
            self.next_burst += (self.scenario.latch_every_s or 1e9) * NS_PER_S
        fate = fates[self.camera] = self.fate(pulse)
        if fate is FrameStatus.MISSED:
            return
        frame_id, self.next_id = self.next_id, self.next_id + 1
        if self.scenario.modulus and self.next_id > self.scenario.modulus:
            self.next_id = 1
        self.triggers += 1
        if fate is FrameStatus.LOST:
            return
        slot = pulse * self.scenario.cameras + self.camera
        self.hill.pulse_of[slot] = pulse
        retention = self.scenario.retention_ns if fate is FrameStatus.DAMAGED else 0
        # Frames come in the camera's order: a late one holds up those behind it.
        exposure = self.scenario.exposures_ns[self.camera] if self.scenario.exposures_ns else 0
        arrival = max(
            self.last_arrival,
            HostNs(
                time + exposure + self.rng.randint(*self.scenario.latency_ns) + retention
                + self.scenario.bursts.get((pulse, self.camera), 0)
            ),
        )  # fmt: skip
        self.last_arrival = arrival
        if fate is FrameStatus.DAMAGED:
            about = None
            if self.scenario.damage_tells_time:
                about = self.device(time + self.rng.randint(-MS // 5, MS // 5))
            record: Record = _Torn(arrival, about, self.epoch, slot)
        else:
            noted = time + exposure * (self.camera in self.scenario.note_the_end)
            device = self.device(noted + self.rng.random() * self.scenario.jitter_ns)
            count = self.triggers if self.scenario.trigger_counts else -1
            record = FrameRecord(arrival, slot, frame_id, self.scenario.modulus, device, count, epoch=self.epoch)
        self.put(arrival, record)
        taken = record.device_time if isinstance(record, FrameRecord) else None
        if self.scenario.latch_every_s is not None and (self.reading.is_due(arrival, taken) or self.reading.wanted):
            read = max(arrival, self.reading.earliest)
            self.latch_burst(read, 1, self.link_rng)
            self.reading.done(read)

    def fate(self, pulse: int) -> FrameStatus:
        scenario = self.scenario
        fault = scenario.faults.get((pulse, self.camera))
        if fault is not None:
            return fault
        chances = [scenario.missed, scenario.lost, scenario.damaged]
        names = [FrameStatus.MISSED, FrameStatus.LOST, FrameStatus.DAMAGED, FrameStatus.OK]
        return self.rng.choices(names, [*chances, 1 - sum(chances)])[0]

    def put(self, arrival: HostNs, record: Record) -> None:
        self.records.append((arrival, self.camera, record))


@dataclass
class Run:
    """A hill whose records went through a pairer.

    Attributes:
        closed: the decided pulses.
        unplaced: slots of the whole frames that the pairer refused.
        silent: cameras that were silent at some time.
        overdue: cameras that were overdue at some time.
        most_open: most pulses undecided at a time.
    """

    hill: Hill
    pairer: Pairer = field(init=False)
    closed: list[ClosedPulse] = field(default_factory=list)
    unplaced: list[int] = field(default_factory=list)
    silent: set[int] = field(default_factory=set)
    overdue: set[int] = field(default_factory=set)
    most_open: int = 0

    def __post_init__(self) -> None:
        scenario = self.hill.scenario
        self.pairer = Pairer(
            scenario.cameras, scenario.period_ns, hold_ns=scenario.hold_ns, exposures_ns=scenario.exposures_ns
        )
        for now, batch in _batches(self.hill.events, scenario.batch_ns):
            if scenario.batch_ns == 0:
                self.pass_deadlines(now)
            for camera, record in batch:
                self.feed(camera, record)
            self.advance(now)
        self.pass_deadlines(None)

    def feed(self, camera: int, record: Record) -> None:
        match record:
            case FrameRecord():
                pulse = self.pairer.frame(camera, record)
                if pulse is not None or not self.pairer.holds(camera, record):
                    self.place(record, pulse)
            case DamagedRecord():
                self.pairer.damaged(camera, record)
            case LatchRecord():
                self.pairer.latch(camera, record.latch)
            case ConnectedRecord():
                self.pairer.connected(camera, record.epoch, record.host_time)
            case DisconnectedRecord():
                self.pairer.disconnected(camera, record.host_time)

    def place(self, record: FrameRecord, pulse: OpenPulse | None) -> None:
        if pulse is None:
            self.unplaced.append(record.slot)
        else:
            _load(pulse, record)

    def place_released(self, now: HostNs) -> None:
        for frame in self.pairer.released(now):
            self.place(frame.record, frame.pulse)

    def pass_deadlines(self, until: HostNs | None) -> None:
        while (deadline := self.pairer.next_deadline()) is not None and (until is None or deadline < until):
            self.advance(deadline)

    def advance(self, now: HostNs) -> None:
        self.place_released(now)
        self.closed += self.pairer.advance(now)
        self.silent |= set(self.pairer.silent())
        self.overdue |= set(self.pairer.overdue(now))


def _load(pulse: OpenPulse, record: FrameRecord) -> None:
    """Keep the frame's slot in the cargo of the pulse, as the recorder does."""
    if pulse.cargo is None:
        pulse.cargo = []
    assert isinstance(pulse.cargo, list)
    pulse.cargo.append(record.slot)


def _batches(
    events: list[tuple[HostNs, int, Record]], batch_ns: int
) -> Iterator[tuple[HostNs, list[tuple[int, Record]]]]:
    """The events in the order in which the recorder reads them when it wakes."""
    index = 0
    while index < len(events):
        now = HostNs(events[index][0] + batch_ns)
        end = index
        while end < len(events) and events[end][0] <= now:
            end += 1
        batch = [(camera, record) for _, camera, record in events[index:end]]
        yield now, sorted(batch, key=lambda entry: entry[0])
        index = end
