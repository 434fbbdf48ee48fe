"""The protocol for the geodesist: everything that was found, and what was refused."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.report.fates import CAPTION, WHY
from analysis.report.protocol import WORST_RAYS, protocol, write_protocol
from analysis.report.protocol_norwegian import norwegian
from analysis.result.fates import Fate
from analysis.result.model import CameraMove, CameraOffset, MeasuredRecording, RayTest
from photogrammetry.procedures.orientation import orient
from photogrammetry.reports.document import Report, Table, as_text
from rig.phrase import phrase, plain
from rig.pulse import PulseNumber
from tests.analysis.report.jumps import measured_recording, measurements
from tests.photogrammetry.synthetic import hill

#: What is called the same in Norwegian, and names.
_SAME = {
    "ball", "parameter", "a priori", "omega", "phi", "kappa", "rms vx", "rms vy", "sigma", "sigma (ms)", "sigma0",
    *(f"sigma {name}" for name in ("1", "2", "3", "X", "Y", "Z", "X0", "Y0", "Z0", "omega", "phi", "kappa")),
    *(f"hill-{image}{what}" for image in (1, 2, 3) for what in ("", " X0", " Z0", " angle 1", " angle 2")),
}  # fmt: skip


def _text(result: MeasuredRecording) -> str:
    return as_text(protocol(result, measurements())).replace("\N{MINUS SIGN}", "-")


def _section(text: str, title: str) -> str:
    return text.split(f"\n{title}\n", 1)[1].split("\n\n", 1)[0]


def test_cameras_balls_and_synchrony_are_listed() -> None:
    text = _text(measured_recording())
    poses = _section(text, "Orientation of the cameras")
    assert [line.split()[0] for line in poses.splitlines() if line.startswith("  K")] == ["K1", "K2", "K3"]
    assert "no camera moved" in poses
    assert "12 of 14 balls found" in poses
    assert "B7    control   7.608   8.464  -3.557  12.0  12.0  12.0  K1 K2 K3" in _section(text, "Balls")
    assert "K3             0.20        0.20             1.0  synchronous" in _section(text, "Synchrony")


def test_faults_are_listed_with_their_words() -> None:
    result = measured_recording()
    move = CameraMove("K2", plain("camera K2 turned by 0.05°"), np.zeros(3), np.zeros(3), 1e-9)
    late = CameraOffset(33.3, 0.2, plain("camera K3 is one frame late"))
    text = _text(
        replace(
            result,
            orientation=replace(result.orientation, moved=(move,)),
            synchrony=dict(result.synchrony) | {"K3": late},
        )
    )
    assert "moved: camera K2 turned by 0.05° (p = 1.0e-09)" in text
    assert "166.5  camera K3 is one frame late" in text


def test_rays_are_listed_worst_first_and_removed_ones_whole() -> None:
    result = measured_recording()
    w = np.random.default_rng(1).standard_normal(200)
    tests = [RayTest(PulseNumber(20 + i // 9), "K1", "P1", 0.3, float(w[i]), False) for i in range(200)]
    removed = [RayTest(PulseNumber(30 + i), "K2", "P2", 5.0, 0.001 * i, True) for i in range(3)]
    jump = replace(result.jumps[0], tests=(*tests, *removed, *result.jumps[0].tests[-1:]))
    text = _text(replace(result, jumps=(jump,)))
    rows = [line.split() for line in _section(text, "Jump 1: tests of rays, the worst first").splitlines()[3:]]
    values = [abs(float(row[4])) for row in rows]
    assert len(values) == WORST_RAYS
    assert values == sorted(values, reverse=True)
    assert f"{np.count_nonzero(np.abs(w) > 2)} of them with |w| > 2" in text
    assert "1 are controlled by nothing" in text
    refused = _section(text, "Jump 1: what is missing, and why")
    assert "3 rays or image lines were left out as gross errors" in refused
    assert refused.count("removed") == 3


def test_what_has_no_solution_is_named_with_its_pulses() -> None:
    first = measured_recording().jumps[0].pulses[0].pulse
    refused = _section(_text(measured_recording()), "Jump 1: what is missing, and why")
    gap = f"pulses {first + 14}-{first + 18}"
    assert f"P1: no raw solution at {gap}: {WHY[Fate.DISAGREE]}" in refused
    assert f"P4: two rays, not controllable, at pulses {first + 8}-{first + 11}" in refused


def test_phases_have_their_figures() -> None:
    text = _text(measured_recording())
    verdict = _section(text, "Jump 1: verdict")
    assert "reliable: measured in all phases" in verdict
    assert "chi2_by_dof" in verdict
    assert "  flight      25         1.02" in verdict
    assert re.search(r"^  flight +P1 +20 +0 +0 +0 +5$", text, re.MULTILINE)


def test_the_adjustment_of_the_balls_is_part_of_it() -> None:
    orientation = orient(hill(1).network)
    text = as_text(protocol(measured_recording(), measurements(), orientation))
    assert "Network of balls: Stage 1" in text
    assert text.index("Jump 1: verdict") < text.index("Network of balls")


def test_nothing_of_the_session_stands_in_it() -> None:
    session = {"athlete": "Anna Øverbø", "bib": "No. 4711", "notes": "sore knee", "operator": "Kari Ås"}
    result = replace(measured_recording(), session=session | {"note.3": "slipped on the table"})
    english = protocol(result, measurements())
    texts = "\n".join([*_texts(english), *_texts(norwegian(english, result))])
    assert [text for text in result.session.values() if text in texts] == []


def test_text_is_english_and_the_page_is_norwegian_too(tmp_path: Path) -> None:
    text, page = write_protocol(measured_recording(), measurements(), tmp_path / "new")
    assert text.read_text().startswith("Protocol of recording simulated")
    assert '<h2><span lang="en">Synchrony</span><span lang="nb">Samtidighet</span></h2>' in page.read_text()
    assert "<td>K1</td>" in page.read_text()  # what is the same in both stands once


def test_every_sentence_and_every_head_has_its_norwegian() -> None:
    result, measured = measured_recording(), measurements()
    verdict = phrase("jump_counted", "all points in {count} of {pulses} pulses in sight", count=24, pulses=25)
    jump = replace(
        result.jumps[0], verdict=replace(result.jumps[0].verdict, message=f"measured well: {verdict}", said=(verdict,))
    )
    counts = "camera K1: 14 of 15 surveyed balls in sight named, 21 balls measured, 35 round spots found"
    result = replace(result, jumps=(jump,), orientation=replace(result.orientation, messages=(counts,)))
    english = protocol(result, measured, orient(hill(1).network))
    texts = list(zip(_texts(english), _texts(norwegian(english, result)), strict=True))
    assert {one for one, other in texts if one == other and re.search("[a-z]{3}", one)} == _SAME
    said = dict(texts)
    assert said[f"reliable: measured well: {verdict}"] == "pålitelig: godt målt: alle punkter i 24 av 25 pulser i sikte"
    assert said[counts].startswith("kamera K1: 14 av 15 innmålte baller i sikte har fått navn")


def _texts(report: Report) -> Iterator[str]:
    for section in report.sections:
        yield section.title
        for part in section.parts:
            if isinstance(part, Table):
                yield from (*part.head, *(cell for row in part.rows for cell in row))
            else:
                yield part if isinstance(part, str) else part.caption


def test_the_page_draws_what_became_of_each_point(tmp_path: Path) -> None:
    result = measured_recording()
    _, page = write_protocol(result, measurements(), tmp_path)
    text = page.read_text()
    assert text.count(f'aria-label="{CAPTION.format(cameras="K1, K2, K3")}"') == len(result.jumps)
    bare = replace(result.jumps[0], pulses=tuple(replace(p, fates={}) for p in result.jumps[0].pulses))
    assert "What became of each point" not in _text(replace(result, jumps=(bare,)))
