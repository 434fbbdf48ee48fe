"""A light barrier on a GPIO line begins recordings: a real service and the real libgpiod, on an emulated chip."""

import tempfile
from pathlib import Path

from recorder.checking.verify import verify
from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until


def _finished(service: Serving) -> list[str]:
    recordings = service.get("/api/recordings")
    return [recording["id"] for recording in recordings if recording["state"] == "finished"]


def test_an_interrupted_light_barrier_is_one_recording_however_it_bounces(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback, names=["K1"], rate_hz=15.0)
    with tempfile.TemporaryDirectory() as folder, GpioChip(Path(folder) / "gpiochip0") as chip:
        barrier = f'{{ chip = "{chip.path}", line = 2, active_low = true, debounce_ms = 20 }}'
        table = f"[automatic]\nbefore_s = 0.5\nafter_s = 0.5\nbarrier = {barrier}\n"
        rig.write_text(rig.read_text().replace("[[cameras]]", table + "[[cameras]]", 1))
        chip.drive(2, high=True)
        with serving(tmp_path, rig, loopback, environment=environment()) as service:
            chip.wait_for_use(2, used=True)
            assert chip.requests[0].debounce_us == 20_000
            chip.drive(2, high=False)  # nobody is interested while the rig is not armed
            chip.wait_until_settled(2)
            chip.drive(2, high=True)
            chip.wait_until_settled(2)
            service.arm()
            for high in (False, True, False, True, False):
                chip.drive(2, high=high)
            wait_until(lambda: len(_finished(service)) == 1, "the jump is recorded", 60, 0.1)
            (recording,) = _finished(service)
            said = [
                event.message for event in verify(service.data / f"{recording}.mcap").events if event.name == "mark"
            ]
            assert len(said) == 1
            assert "a jump is marked by light barrier" in said[0]
            seen = [each for each in service.get("/api/doctor")["findings"] if each["code"].startswith("check_b")]
            assert [each["code"] for each in seen] == ["check_beam_interrupted"]
        chip.wait_for_use(2, used=False)
