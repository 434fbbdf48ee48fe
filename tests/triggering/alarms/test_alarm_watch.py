"""Alarms of a running rig: from health records as the recorder makes them, one a second."""

import random
from collections.abc import Sequence
from typing import Any

import msgspec
import pytest

from rig.clocks import DecimalNs
from rig.events import PAIRING, TRIGGER, Level
from rig.health import CameraHealth, CameraPairing, DiskHealth, Health, Latency, PairingHealth, PrerollHealth
from rig.settings.model import RigSettings
from triggering.alarms.watch import AlarmWatch

NAMES = ("K1", "K2", "K3")
CAUSES = ("missed", "lost", "damaged", "overruns", "late")


def _rig(rate_hz: float, **trigger: Any) -> RigSettings:
    cameras = [{"name": name, "backend": "sim", "exposure_us": 2000.0} for name in NAMES]
    return RigSettings.model_validate(
        {
            "name": "test", "cameras": cameras, "simulation": {"scenario": "training.toml"},
            "trigger": {"rate_hz": rate_hz, **trigger},
        }
    )  # fmt: skip


class Running:
    """A rig whose pulses come as a test says; one health record a second.

    Attributes:
        told: code and whether it is over, of each alarm that began or ended.
        levels: level and name by the code of each alarm.
    """

    def __init__(self, rate_hz: float = 30.0, **trigger: Any) -> None:
        self.watch = AlarmWatch(_rig(rate_hz, **trigger))
        self.told: list[tuple[str, bool]] = []
        self.levels: dict[str, tuple[Level, str]] = {}
        self.said: list[str] = []
        self._counts: list[dict[str, Any]] = [dict.fromkeys(("ok", "doubted", *CAUSES), 0) for _ in NAMES]
        self._fetched: list[dict[str, Any]] = [{"missing_packets": 0, "underruns": 0} for _ in NAMES]
        self._seen, self._now = 0, 0.0
        self.rate_hz = rate_hz

    def second(
        self, pulses: int | None = None, failed: Sequence[dict[str, int]] = ({}, {}, {}), *, seconds: float = 1.0,
        away: Sequence[int] = (), overloaded: Sequence[int] = (), offsets: Sequence[float] = (0.0, 0.0, 0.0),
        underruns: int = 0, **pairing: Any,
    ) -> None:  # fmt: skip
        """Enter the record of a second: how many pulses came, and how many of them failed in each camera, and how."""
        new = round(self.rate_hz) if pulses is None else pulses
        self._now, self._seen = self._now + seconds, self._seen + new
        for counts, lacking in zip(self._counts, failed, strict=True):
            for cause, number in lacking.items():
                counts[cause] += number
            counts["ok"] += new - sum(lacking.get(cause, 0) for cause in ("missed", "lost", "damaged"))
        self._fetched[1]["underruns"] += underruns
        begun, over = self.watch.look(self._health(away, offsets, pairing), overloaded, self._now)
        self.told += [(alarm.said.code, False) for alarm in begun] + [(alarm.said.code, True) for alarm in over]
        self.said += [str(alarm.said) for alarm in begun]
        self.levels |= {alarm.said.code: (alarm.level, alarm.name) for alarm in begun}

    def _health(self, away: Sequence[int], offsets: Sequence[float], pairing: dict[str, Any]) -> Health:
        paired = tuple(
            CameraPairing(
                connected=index not in away, silent=False, clock_known=True, clock_offset_ns=DecimalNs(0),
                clock_drift_ppm=0.0, clock_uncertainty_us=60.0, latency_ms=8.0, **counts,
            )
            for index, counts in enumerate(self._counts)
        )  # fmt: skip
        figures = {
            "pulses": self._seen, "proven_by_ids": 0, "unwatched": 0, "open": 0, "period_us": 1e6 / self.rate_hz,
            "spread_median_us": 20.0, "spread_max_us": 60.0, "spread_usual_us": 40.0, "alarm": False,
            "rate_hz": self.rate_hz, **pairing,
        }  # fmt: skip
        cameras = tuple(
            CameraHealth(
                name=name, connected=index not in away, frames_per_s=0, clock_offset_us=offsets[index],
                temperature_c=None, frames=0, damaged=0, resent_packets=0, reconnects=0, temperature_mdeg=0,
                queue_overflows=0, slots_queued=0, **self._fetched[index],
            )
            for index, name in enumerate(NAMES)
        )  # fmt: skip
        return Health(
            cameras, PairingHealth(cameras=paired, **figures), 10, 0, PrerollHealth(5.0, 5.0, 150, 100.0), None,
            DiskHealth(None), Latency({}, 0.0, 0),
        )  # fmt: skip


def lacking(**failed: int) -> tuple[dict[str, int], dict[str, int], dict[str, int]]:
    """K2 alone fails."""
    return {}, failed, {}


def test_stopped_pulses_are_told_of_once_and_so_is_their_return() -> None:
    for rate_hz in (1.0, 30.0, 200.0):
        rig = Running(rate_hz)
        for _ in range(70):
            rig.second()
        for _ in range(12):
            rig.second(0)
        assert rig.told == [("alarm_stopped", False)], rate_hz
        assert rig.levels["alarm_stopped"] == (Level.ERROR, TRIGGER)
        for _ in range(12):
            rig.second()
        assert rig.told == [("alarm_stopped", False), ("alarm_stopped", True)]
        assert not rig.watch.present


def test_pulses_are_not_missed_that_need_not_come() -> None:
    waiting, by_hand, gated, away = Running(), Running(), Running(gated=True), Running()
    for second in range(40):
        waiting.second(0)
        by_hand.second(second % 2, rate_hz=None)
        gated.second()
        away.second()
    for _ in range(40):
        by_hand.second(0)
        gated.second(0)
        away.second(0, away=(0, 1, 2))
    assert waiting.told == by_hand.told == gated.told == away.told == []


def test_pulses_that_are_stopped_on_purpose_are_no_alarm_and_those_that_do_not_come_back_are_one() -> None:
    rig = Running()
    for _ in range(10):
        rig.second()
    for _ in range(40):
        rig.watch.expect_pauses()
        rig.second(0)
    assert rig.told == []
    for _ in range(3):
        rig.second(0)
    assert rig.told == [("alarm_stopped", False)]


def test_a_rate_that_leaves_its_history_but_not_the_rig_file() -> None:
    rig = Running()
    scatter = random.Random(4)
    for _ in range(60):
        rig.second(rate_hz=30.2 + scatter.gauss(0, 0.01))
    assert rig.told == []
    for rate in (30.05, 29.95, 29.8, 29.85, 29.8, 29.95, 30.0):
        rig.second(rate_hz=rate)
    assert rig.told == [("alarm_drift", False)]
    assert "from 30.2 to 29.8 Hz: check what makes them" in rig.said[0]
    for _ in range(10):
        rig.second(rate_hz=30.2)
    assert rig.told == [("alarm_drift", False), ("alarm_drift", True)]


def test_a_rate_that_contradicts_the_rig_file_does_not_flap() -> None:
    rig = Running()
    for second in range(30):
        rig.second(rate_hz=30.7 if second % 3 else 30.5)
    assert rig.told == [("pairing_rate", False)]
    assert rig.levels["pairing_rate"] == (Level.WARNING, PAIRING)


def test_a_spread_warns_at_five_percent_and_alarms_at_a_quarter() -> None:
    rig = Running()
    for usual_us in [40.0] * 10 + [1500.0] * 5 + [1800.0, 1500.0, 1700.0] * 3:
        rig.second(spread_usual_us=usual_us, offsets=(5.0, -1700.0, 6.0))
    assert rig.told == [("alarm_spread", False)]
    assert rig.said[0].startswith("the frames of one pulse lie 1.8 ms apart, 5 % of the period, K2 farthest off: ")
    for _ in range(3):
        rig.second(spread_usual_us=9000.0, spread_max_us=9000.0, alarm=True)
    assert rig.told == [("alarm_spread", False), ("pairing_spread", False)]
    assert [alarm.level for alarm in rig.watch.present] == [Level.ERROR]
    for _ in range(3):
        rig.second()
    assert len(rig.told) == 2, "it is not over at the first good pulses"
    for _ in range(5):
        rig.second()
    assert rig.told[2:] == [("pairing_spread", True)]


def test_clocks_that_are_not_known_so_well_are_no_spread() -> None:
    rig = Running(200.0)
    for _ in range(10):
        rig.second(spread_usual_us=110.0)
    assert rig.told == []


@pytest.mark.parametrize("rate_hz", [30.0, 200.0])
def test_clean_pulses_give_no_alarm_in_half_an_hour(rate_hz: float) -> None:
    rig, chance = Running(rate_hz), random.Random(11)
    for _ in range(1800):  # what a good rig loses: one frame in a thousand
        rig.second(failed=[{"lost": sum(chance.random() < 1e-3 for _ in range(round(rate_hz)))} for _ in NAMES])
    assert rig.told == []


@pytest.mark.parametrize(
    ("failed", "more", "code"),
    [
        (lacking(missed=15), {}, "alarm_missed"),
        (lacking(missed=15, overruns=15), {}, "alarm_exposure"),
        (lacking(missed=15), {"period_us": 2400.0}, "alarm_exposure"),
        (lacking(lost=10, damaged=3), {}, "alarm_link"),
        (lacking(lost=10, late=9), {}, "alarm_slow_link"),
        (lacking(lost=10), {"underruns": 4}, "alarm_computer"),
        (lacking(lost=10), {"overloaded": (0, 1)}, "alarm_computer"),
        (({"missed": 10}, {"missed": 10}, {"missed": 10}), {}, "alarm_missed_alike"),
        (({"lost": 10}, {"lost": 10}, {}), {}, "alarm_bandwidth"),
        (({"lost": 10}, {"lost": 10}, {"lost": 10}), {"overloaded": (0, 1, 2)}, "alarm_computer"),
    ],
)
def test_a_camera_that_misses_pulses_with_its_likely_cause(
    failed: tuple[dict[str, int], ...], more: dict[str, Any], code: str
) -> None:
    rig = Running()
    for _ in range(10):
        rig.second()
    for _ in range(5):
        rig.second(failed=failed, **more)
    ill = ", ".join(name for name, lacks in zip(NAMES, failed, strict=True) if lacks)
    assert rig.told == [(code, False)]
    assert rig.levels[code][0] is Level.ERROR
    (alarm,) = rig.watch.present
    assert alarm.said.values["camera"] == ill
    assert alarm.name == ("computer" if code == "alarm_computer" else "trigger" if "," in ill else ill)
    for _ in range(50):  # some 1100 good pulses
        rig.second()
    assert rig.told == [(code, False), (code, True)]


def test_a_computer_that_is_too_slow_is_one_alarm_and_no_cable_is_accused_any_more() -> None:
    rig, lost = Running(), {"lost": 10}
    for _ in range(3):
        rig.second(failed=({}, lost, {}))
    assert rig.told == [("alarm_link", False)]
    for _ in range(5):
        rig.second(failed=(lost, lost, lost), overloaded=(0, 1, 2))
    assert rig.told == [("alarm_link", False), ("alarm_computer", False), ("alarm_link", True)]
    for _ in range(5):
        rig.second(failed=(lost, lost, lost))
    (alarm,) = rig.watch.present
    assert str(alarm.said).startswith("frames of K1, K2, K3 get lost, 300 of 900, since this computer is too slow: ")


def test_what_a_computer_that_is_too_slow_does_to_rate_and_spread_is_no_alarm_of_its_own() -> None:
    rig, lost = Running(), {"lost": 10}
    for _ in range(10):
        rig.second(rate_hz=30.7, spread_usual_us=1800.0)
    assert {code for code, _ in rig.told} == {"pairing_rate", "alarm_spread"}
    for _ in range(3):
        rig.second(failed=(lost, lost, lost), overloaded=(0, 1, 2), rate_hz=30.7, spread_usual_us=1800.0)
    assert [alarm.said.code for alarm in rig.watch.present] == ["alarm_computer"]
    for _ in range(5):  # the alarm of the computer is not over yet
        rig.second(failed=(lost, lost, lost), rate_hz=30.7, spread_usual_us=1800.0)
    assert [alarm.said.code for alarm in rig.watch.present] == ["alarm_computer"]
    rig.second(overloaded=(0, 1, 2), spread_usual_us=9000.0, spread_max_us=9000.0, alarm=True)
    assert "pairing_spread" in {alarm.said.code for alarm in rig.watch.present}, "that frames are paired wrongly counts"


def test_frames_that_contradict_their_times_because_they_come_late_are_no_alarm_of_their_own() -> None:
    rig, lost = Running(), {"lost": 10}
    doubted = {"lost": 10, "doubted": 5}
    rig.second(failed=({"doubted": 5}, {}, {}))
    assert [code for code, _ in rig.told] == ["pairing_doubt"]
    for _ in range(3):
        rig.second(failed=(doubted, lost, lost), overloaded=(0, 1, 2))
    assert [alarm.said.code for alarm in rig.watch.present] == ["alarm_computer"]


def test_what_two_cameras_have_in_turn_is_one_alarm() -> None:
    rig, lost = Running(), {"lost": 10}
    for _ in range(3):
        rig.second(failed=(lost, {}, {}))
    for _ in range(5):
        rig.second(failed=(lost, lost, {}))
    assert [alarm.said.values["camera"] for alarm in rig.watch.present] == ["K1, K2"]


def test_the_figures_of_an_alarm_are_of_the_last_seconds() -> None:
    rig = Running()
    for _ in range(10):
        rig.second(failed=lacking(missed=15))
    for _ in range(8):
        rig.second(failed=lacking(missed=1))
    (alarm,) = rig.watch.present
    assert str(alarm.said).startswith("K2 misses pulses, 38 of 300: ")
    assert rig.told == [("alarm_missed", False)], "it is told of once"


def test_one_frame_in_fifty_is_told_of_and_the_alarm_does_not_flap() -> None:
    rig, chance = Running(), random.Random(3)
    for _ in range(1800):
        rig.second(failed=lacking(missed=sum(chance.random() < 0.02 for _ in range(30))))
    assert rig.told == [("alarm_missed", False)]


def test_a_camera_that_is_away_tells_that_itself() -> None:
    rig = Running()
    for _ in range(5):
        rig.second()
    rig.second(failed=lacking(lost=20), away=(1,))
    for _ in range(5):
        rig.second(failed=lacking(), away=(1,))
    rig.second(failed=lacking(lost=9))
    for _ in range(5):
        rig.second()
    assert rig.told == []


def test_what_is_over_is_said_without_the_advice() -> None:
    rig = Running()
    for _ in range(3):
        rig.second(failed=lacking(missed=15))
    (alarm,) = rig.watch.present
    assert str(alarm.said) == "K2 misses pulses, 30 of 60: check its trigger cable and the plug"
    assert str(alarm.over) == "over: K2 misses pulses, 30 of 60"
    assert msgspec.json.decode(msgspec.json.encode(alarm.over.values))["what"]["code"] == "alarm_missed"
