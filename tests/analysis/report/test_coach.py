"""The coach's page: shows the result's numbers, needs nothing from elsewhere, says what is not known."""

import base64
import hashlib
import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from analysis.measurements.model import POINTS, SIDES
from analysis.report.coach import report_page, write_report
from analysis.report.course import course_of
from analysis.report.crops import crops_of, windows_of
from analysis.report.figures import five_figures, value_and_sigma
from analysis.report.norwegian import SENTENCES
from analysis.report.scrubbing import overlays_of
from analysis.result.model import CameraMove, JumperState, MeasuredRecording, Quantity
from photogrammetry.jumper.stick_model import ANGLES
from rig.errors import BadInputError
from rig.phrase import phrase, plain
from tests.analysis.report.jumps import EVERY, measured_recording, measurements
from tests.analysis.result.recordings import without_takeoff
from tests.analysis.simulated import RATE_HZ, true_cameras

PERPENDICULAR = {1: Quantity(2.314, 0.082)}
NASTY = {"athlete": "Ola </script><b>Nordmann</b>", "bib": '1"7', "club": "<img src=x onerror=alert(1)>", "gate": ""}
NOTED = {"notes": "sore knee", "operator": "Kari", "tags": "fall", "favourite": "yes", "note.31": "ski opens"}


def _page(log: Path, result: MeasuredRecording) -> str:
    return report_page(result, measurements(), true_cameras(), log, PERPENDICULAR)


@pytest.fixture(scope="module")
def page(jump_log: Path) -> str:
    """The page of one jump."""
    return _page(jump_log, replace(measured_recording(), session=NASTY | NOTED))


def test_what_was_noted_about_the_athlete_is_not_on_a_page_that_is_sent_on(page: str) -> None:
    assert not [
        text
        for text in ("sore knee", "Kari", "fall", "favourite", "note.31")
        if re.search(rf">[^<]*{text}[^<]*<", page)
    ]


def _frames(page: str) -> list[dict[str, Any]]:
    found = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    return [frame for text in found for frame in json.loads(text)]


def _text(page: str, language: str = "en") -> str:
    """What a person reads in one language."""
    other = {"en": "nb", "nb": "en"}[language]
    page = re.sub(rf'<(span|p|li) (class="alarm" )?lang="{other}">.*?</\1>', "", page, flags=re.DOTALL)
    page = re.sub(rf'<div lang="{other}"><strong>.*?</div>', "", page, flags=re.DOTALL)
    page = re.sub(rf'<div lang="{other}"><h3>.*?</figure></div></div>', "", page, flags=re.DOTALL)
    body = re.sub(r"<(script|style)\b.*?</\1>", "", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", body)).split())


def test_the_five_numbers_are_those_of_the_result(page: str) -> None:
    five = five_figures(course_of(measured_recording().jumps[0], RATE_HZ), PERPENDICULAR[1])
    numbers = re.findall(r'class="value">([^<]+)</span> <span class="sigma">± ([^<]+)</span>', page)
    expected = [value_and_sigma(figure.quantity, figure.unit) for figure in five if figure.quantity is not None]
    assert [(value.rstrip("°"), sigma.rstrip("°")) for value, sigma in numbers] == expected
    assert len(expected) == 5
    assert "2.31 ± 0.08 m/s" in _text(page)


def test_verdict_and_definitions_are_said(page: str) -> None:
    text = _text(page)
    assert "You can rely on these numbers measured in all phases" in text
    assert "no wind assumed" in text
    assert "1.1 s after take-off" in text
    assert '<html lang="en">' in page


def test_all_of_it_is_said_in_norwegian_too(page: str) -> None:
    text, english = _text(page, "nb"), _text(page)
    assert "Du kan stole på disse tallene" in text
    for word in ("the ", "take-off", "pulse ", "Speed", "camera", "flight"):
        assert word in english or word in page
        assert word not in text.replace("protocol.html", ""), text[max(0, text.find(word) - 60) : text.find(word) + 40]
    assert "startnummer 1" in text
    # Nothing is in one language only.
    for tag in ("span", "p", "div"):
        assert page.count(f'<{tag} lang="en"') == page.count(f'<{tag} lang="nb"')


def test_a_verdict_with_codes_is_said_in_norwegian(jump_log: Path) -> None:
    result = measured_recording()
    where = phrase("jump_in_flight", " in flight")
    said = phrase(
        "jump_coarse", "in {coarse} of {pulses} pulses{where} a point is uncertain by more than {limit} m",
        coarse=3, pulses=9, where=where, limit=0.02,
    )  # fmt: skip
    verdict = replace(result.jumps[0].verdict, ok=False, message=said.text, said=(said, plain("as it is")))
    page = _page(jump_log, replace(result, jumps=(replace(result.jumps[0], pulses=(), verdict=verdict),)))
    assert "i 3 av 9 pulser i svevet er et punkt mer usikkert enn 0,02 m; as it is" in _text(page, "nb")
    assert "in 3 of 9 pulses in flight a point is uncertain by more than 0.02 m; as it is" in _text(page)


def test_the_sentences_are_those_of_the_panel() -> None:
    panel = (Path(__file__).parents[3] / "webpanel" / "page" / "i18n" / "nb-analysis.js").read_text(encoding="utf-8")
    assert dict(re.findall(r'^  (\w+): \["(.*)"\],$', panel, re.MULTILINE)) == SENTENCES


def test_the_session_is_text_and_nothing_else(page: str) -> None:
    assert "Ola </script><b>Nordmann</b>" in _text(page)
    assert '1"7' in _text(page)
    assert "<img src=x" not in page
    assert "gate" not in _text(page)


def test_the_recording_is_named_once(jump_log: Path) -> None:
    result = measured_recording()
    page = _page(jump_log, replace(result, session={"athlete": "Ola", "recording": result.recording}))
    assert _text(page).count(f"recording {result.recording}") == 1


def test_nothing_comes_from_elsewhere(page: str) -> None:
    assert "://" not in page.replace("http://www.w3.org/2000/svg", "")
    policy = re.search(r'<meta http-equiv="Content-Security-Policy" content="([^"]+)">', page)
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; img-src data:;")
    assert "unsafe" not in policy[1]
    inline = [
        *re.findall(r"<style>(.*?)</style>", page, re.DOTALL),
        *re.findall(r"<script>(.*?)</script>", page, re.DOTALL),
    ]
    assert len(inline) == 2
    for text in inline:
        assert f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" in policy[1]
    assert not re.search(r'\sstyle="|\son\w+="', page)


def test_every_pulse_can_be_scrubbed_in_the_views_that_show_the_jumper(page: str) -> None:
    frames, jump = _frames(page), measured_recording().jumps[0]
    assert len(frames) == len(jump.pulses)
    views = [view for frame in frames for view in frame["views"] if view is not None]
    assert len(views) > 0.6 * 3 * len(frames) / EVERY
    assert all(view["src"].startswith("data:image/webp;base64,") for view in views)
    assert all('class="right"' in view["over"] for view in views)
    state = jump.pulses[10].smoothed
    assert state is not None
    assert frames[10]["numbers"][2] == "{}° ± {}°".format(*value_and_sigma(state.angles["alpha"] or Quantity(0, 1)))
    assert set(frames[10]["stick"]) == {"body", "feet", "right", "left"}
    assert len(page) < 8_000_000


def test_pictures_are_made_worse_until_they_fit(jump_log: Path) -> None:
    course = course_of(measured_recording().jumps[0], RATE_HZ)
    overlays = overlays_of(course, range(0, 36, EVERY), None, true_cameras())
    windows = windows_of(overlays, true_cameras())
    sizes = []
    for budget in (10_000_000, 100_000):
        sizes.append(sum(len(crop.data) for crop in crops_of(jump_log, windows, budget).values()))
    assert sizes[1] < 110_000 < sizes[0]  # the level is chosen from a sample


def test_a_bad_verdict_and_a_moved_camera_are_said_on_top(jump_log: Path) -> None:
    result = measured_recording()
    bad = replace(
        result.jumps[0], pulses=(), verdict=replace(result.jumps[0].verdict, ok=False, message="K2 & K3 <disagree>")
    )
    zero = true_cameras()["K1"].position
    moved = CameraMove("K2", plain("camera K2 turned by 0.05° to the left"), zero, zero, 1e-9)
    orientation = replace(result.orientation, moved=(moved,))
    text = _text(_page(jump_log, replace(result, jumps=(bad,), orientation=orientation)))
    assert "Do not rely on these numbers K2 & K3 <disagree>" in text
    assert text.index("Attention: camera K2 turned by 0.05° to the left") < text.index("Do not rely")


def test_without_a_take_off_nothing_is_invented(jump_log: Path) -> None:
    result = without_takeoff(measured_recording())
    short = replace(result.jumps[0], pulses=result.jumps[0].pulses[:6])
    text = _text(_page(jump_log, replace(result, jumps=(short,))))
    assert text.count("not measured") == 4  # the fifth was given
    assert "distance from the first pulse (m)" in text  # charts of single pulses


@pytest.mark.parametrize("pulses", [0, 1, 8])
def test_jumps_in_which_nothing_was_measured_are_shown_as_such(jump_log: Path, pulses: int) -> None:
    nothing = JumperState(dict.fromkeys(POINTS), dict.fromkeys(SIDES), dict.fromkeys(ANGLES), None, None)
    jump = measured_recording().jumps[0]
    bare = tuple(replace(pulse, raw=nothing, smoothed=None) for pulse in jump.pulses[:pulses])
    page = _page(jump_log, replace(measured_recording(), jumps=(replace(jump, pulses=bare, takeoff=None),)))
    assert _text(page).count("not measured") == 4
    assert all(frame["stick"] == {} for frame in _frames(page))


def test_a_recording_without_a_jump_says_so(jump_log: Path) -> None:
    assert "There is no jump in this recording." in _text(_page(jump_log, replace(measured_recording(), jumps=())))


def test_each_jump_has_its_part(jump_log: Path) -> None:
    jump = measured_recording().jumps[0]
    short = replace(jump, pulses=jump.pulses[::6])
    page = _page(jump_log, replace(measured_recording(), jumps=(short, replace(short, number=2))))
    assert [f'id="jump-{n}"' in page for n in (1, 2, 3)] == [True, True, False]
    assert "Jump 2" in _text(page)


def test_a_place_that_cannot_be_written_is_named(jump_log: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"nowhere/report\.html: cannot be written .*; choose another place"):
        write_report(
            replace(measured_recording(), jumps=()),
            measurements(),
            true_cameras(),
            jump_log,
            tmp_path / "nowhere" / "report.html",
        )
