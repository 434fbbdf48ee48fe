"""CSV, C3D and TRC, read by parsers that share nothing with what wrote them."""

import csv
import io
import struct
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import c3d
import ezc3d
import numpy as np
import pytest

from analysis.export import c3d_file, motion_files
from analysis.export.places import LABELS, of_state
from analysis.result.model import Jump, JumperState, MeasuredRecording, PointState, Quantity, SkiState, Status
from rig.pulse import PulseNumber
from tests.analysis.result.recordings import HELMET_GAP, LEFT_SKI_GAP, TWO_RAYS, recording, without_takeoff

HALF_SKI = 2.63 / 2
#: OpenSim is not in Svev's environment.
_READERS = Path(__file__).parents[3] / "build" / "readers"


@pytest.fixture(scope="module")
def measured() -> MeasuredRecording:
    return recording(jumps=2)


@pytest.fixture(scope="module")
def folder(measured: MeasuredRecording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("motion")
    names = [path.name for path in motion_files.write(measured, place)]
    assert names == ["jumper.csv", "jumper.c3d", "jumper.trc", "jumper-2.c3d", "jumper-2.trc", "jumper.osim"]
    return place


@dataclass(frozen=True)
class Parsed:
    """A C3D file, byte by byte as c3d.org describes it."""

    first: int
    last: int
    parameters: dict[str, tuple[list[int], bytes]]
    points: np.ndarray  # (frames, points, 4)
    analog: np.ndarray  # (frames, channels)

    def texts(self, name: str) -> list[str]:
        (size, *counts), data = self.parameters[name]
        return [data[i * size : (i + 1) * size].decode().rstrip() for i in range(int(np.prod(counts)))]

    def floats(self, name: str) -> list[float]:
        return [float(v) for v in np.frombuffer(self.parameters[name][1], "<f4")]


def parsed(content: bytes) -> Parsed:
    parameter_block, key, points, analog, first, last = struct.unpack_from("<BBHHHH", content, 0)
    scale, data_block, _, rate = struct.unpack_from("<fHHf", content, 12)
    assert (key, scale, rate) == (0x50, -0.5, 30.0)
    at = (parameter_block - 1) * 512
    assert content[at + 3] == 84  # Intel
    at += 4
    groups: dict[int, str] = {}
    parameters = {}
    while True:
        length, number = struct.unpack_from("<bb", content, at)
        if length == 0:
            break
        name = content[at + 2 : at + 2 + abs(length)].decode()
        offset_at = at + 2 + abs(length)
        step = struct.unpack_from("<h", content, offset_at)[0]
        if number < 0:
            groups[-number] = name
        else:
            size, count = struct.unpack_from("<bB", content, offset_at + 2)
            shape = list(content[offset_at + 4 : offset_at + 4 + count])
            data = content[offset_at + 4 + count :][: abs(size) * int(np.prod(shape))]
            parameters[f"{number}:{name}"] = (shape, data)
        if step == 0:
            break
        at = offset_at + step
    named = {f"{groups[int(k.split(':')[0])]}:{k.split(':')[1]}": v for k, v in parameters.items()}
    frames = last - first + 1
    cells = np.frombuffer(content, "<f4", frames * (4 * points + analog), (data_block - 1) * 512).reshape(frames, -1)
    return Parsed(first, last, named, cells[:, : 4 * points].reshape(frames, points, 4), cells[:, 4 * points :])


def test_the_bytes_of_the_c3d_file(measured: MeasuredRecording, folder: Path) -> None:
    jump = measured.jumps[0]
    file = parsed((folder / "jumper.c3d").read_bytes())
    assert (file.first, file.last) == (jump.pulses[0].pulse, jump.pulses[-1].pulse)
    labels = file.texts("POINT:LABELS")
    assert labels == [*LABELS, *(f"{label}_s" for label in LABELS)]
    assert file.texts("POINT:UNITS") == ["mm"]
    assert file.texts("SVEV:CAMERAS") == ["K1", "K2", "K3"]
    assert file.texts("ANALOG:LABELS")[:3] == ["P1 sigma X", "P1 sigma Y", "P1 sigma Z"]
    assert file.floats("SVEV:TAKEOFF_PULSE") == pytest.approx([jump.takeoff and jump.takeoff.pulse], abs=1e-4)
    for row, pulse in enumerate(jump.pulses):
        for column, label in enumerate(LABELS[:4]):
            point, word = pulse.raw.points[label], file.points[row, column, 3]
            if point is None:
                assert tuple(file.points[row, column]) == (0, 0, 0, -1)
                assert tuple(file.analog[row, 3 * column : 3 * column + 3]) == (-1, -1, -1)
                continue
            sigma = 1e3 * np.sqrt(np.diagonal(point.covariance))
            assert file.points[row, column, :3] == pytest.approx(1e3 * point.xyz, rel=1e-6)  # single precision
            assert file.analog[row, 3 * column : 3 * column + 3] == pytest.approx(sigma, rel=1e-6)
            # a quarter of a millimetre is half a step of the residual
            assert (int(word) & 0xFF) * 0.5 == pytest.approx(np.sqrt(np.mean(sigma**2)), abs=0.25 + 1e-6)
            assert int(word) >> 8 == (0b110 if len(point.cameras) == 2 else 0b111)
    assert file.points[TWO_RAYS[0], 3, 3] > 0
    assert (file.points[LEFT_SKI_GAP[0], [6, 7], 3] == -1).all()
    assert 0 <= file.points[HELMET_GAP[0], len(LABELS), 3] < 256  # predicted: there, but no camera saw it


def test_other_libraries_read_the_c3d_file(measured: MeasuredRecording, folder: Path) -> None:
    path = folder / "jumper-2.c3d"
    file, jump = parsed(path.read_bytes()), measured.jumps[1]
    there = file.points[..., 3] >= 0
    points = ezc3d.c3d(str(path))["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_array_equal(points[there], file.points[..., :3][there])
    assert np.isnan(points[~there]).all()
    reader = c3d.Reader(io.BytesIO(path.read_bytes()))
    for (number, read, analog), row in zip(reader.read_frames(), range(len(jump.pulses)), strict=True):
        assert number == jump.pulses[row].pulse
        np.testing.assert_array_equal(read[there[row], :3], file.points[row, there[row], :3])
        assert (read[~there[row], 3] == -1).all()
        np.testing.assert_allclose(analog[:, 0], file.analog[row], rtol=1e-6)


def moved_to(jump: Jump, shift: np.ndarray, first_pulse: int) -> Jump:
    pulses = tuple(
        replace(
            pulse,
            pulse=PulseNumber(first_pulse + i),
            smoothed=None,
            raw=replace(
                pulse.raw,
                points={
                    name: point and replace(point, xyz=point.xyz + shift, cameras=tuple(f"K{k}" for k in range(1, 9)))
                    for name, point in pulse.raw.points.items()
                },
            ),
        )
        for i, pulse in enumerate(jump.pulses)
    )
    return replace(jump, pulses=pulses, takeoff=None)


def test_c3d_of_a_survey_far_from_zero_with_eight_cameras_late_in_a_long_recording(
    measured: MeasuredRecording, tmp_path: Path
) -> None:
    shift = np.array((569_412.0, 7_032_871.0, 214.0))
    jump = moved_to(measured.jumps[0], shift, 100_000)
    c3d_file.write(jump, 30.0, tuple(f"K{k}" for k in range(1, 9)), tmp_path / "far.c3d")
    file = parsed((tmp_path / "far.c3d").read_bytes())
    assert (file.first, file.floats("SVEV:FIRST_PULSE")) == (1, [100_000.0])
    origin = np.array(file.floats("SVEV:ORIGIN"))
    point = jump.pulses[3].raw.points["P2"]
    assert point is not None
    assert file.points[3, 1, :3] / 1e3 + origin == pytest.approx(point.xyz, abs=1e-5)
    assert int(file.points[3, 1, 3]) >> 8 == 0b111_1111


def test_a_large_sigma_fills_the_residual(tmp_path: Path, measured: MeasuredRecording) -> None:
    jump = measured.jumps[0]
    state = jump.pulses[0].raw
    point = state.points["P1"]
    assert point is not None
    raw = replace(state, points={**state.points, "P1": replace(point, covariance=np.eye(3))})
    c3d_file.write(
        replace(jump, pulses=(replace(jump.pulses[0], raw=raw),)), 30.0, ("K1", "K2", "K3"), tmp_path / "one.c3d"
    )
    assert int(parsed((tmp_path / "one.c3d").read_bytes()).points[0, 0, 3]) == 0x07FF


def test_the_trc_file_read_by_tabs(measured: MeasuredRecording, folder: Path) -> None:
    lines = (folder / "jumper.trc").read_text(encoding="utf-8").split("\n")
    assert lines[0] == "PathFileType\t4\t(X/Y/Z)\tjumper.trc"
    head = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    jump = measured.jumps[0]
    count = len(jump.pulses)
    assert (head["DataRate"], head["NumFrames"], head["NumMarkers"], head["Units"]) == ("30", str(count), "18", "m")
    labels = [cell for cell in lines[3].split("\t")[2:] if cell]
    assert lines[4].split("\t")[2:5] == ["X1", "Y1", "Z1"]
    assert (lines[5], lines[-1], len(lines)) == ("", "", 6 + count + 1)
    rows = [line.split("\t") for line in lines[6:-1]]
    assert {len(row) for row in rows} == {2 + 3 * len(labels)}
    assert [float(row[1]) for row in rows] == pytest.approx(np.arange(count) / 30, abs=1e-6)
    assert "nan" not in "".join(lines).lower()
    for row, pulse in zip(rows, jump.pulses, strict=True):
        assert int(row[0]) == pulse.pulse
        for name in ("P1", "P4"):
            cells, point = row[2 + 3 * labels.index(name) :][:3], pulse.raw.points[name]
            if point is None:
                assert cells == ["", "", ""]
            else:
                x, y, z = (float(cell) for cell in cells)
                assert (x, -z, y) == pytest.approx(point.xyz, abs=1e-5)  # Y is up, handedness kept


def test_the_model_beside_the_trc_files_has_their_markers(folder: Path) -> None:
    markers = {each.get("name"): each for each in ET.parse(folder / "jumper.osim").iter("Marker")}  # noqa: S314 - ours
    for name in ("jumper.trc", "jumper-2.trc"):
        labels = [cell for cell in (folder / name).read_text(encoding="utf-8").split("\n")[3].split("\t")[2:] if cell]
        assert sorted(labels) == sorted(name for name in markers if name)
    for side, binding in (("right", "P3"), ("left", "P4")):
        places = [markers[f"{label}_s"].findtext("location") for label in (f"{side}_tail", binding, f"{side}_tip")]
        assert places == ["-1.3150 0 0", "0.0000 0 0", "1.3150 0 0"]


def test_opensim_reads_model_and_points_and_finds_the_skis(
    measured: MeasuredRecording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(_READERS)])
    opensim = pytest.importorskip("opensim", reason="OpenSim is not there: make readers")
    opensim.Logger.removeFileSink()
    monkeypatch.chdir(tmp_path)
    whole = [
        pulse
        for pulse in measured.jumps[0].pulses
        if pulse.smoothed is not None and len(of_state(pulse.raw)) == len(of_state(pulse.smoothed)) == len(LABELS)
    ]
    run = [pulse for number, pulse in enumerate(whole) if pulse.pulse == whole[0].pulse + number]
    jump = replace(measured.jumps[0], pulses=tuple(run))
    motion_files.write(replace(measured, jumps=(jump,)), tmp_path)
    tool = opensim.InverseKinematicsTool()
    model = opensim.Model("jumper.osim")
    tool.setModel(model)
    tool.setMarkerDataFileName("jumper.trc")
    tool.setStartTime(0.0)
    tool.setEndTime((len(run) - 1) / 30)
    tool.setOutputMotionFileName("jumper.mot")
    assert tool.run()
    motion = opensim.TimeSeriesTable("jumper.mot")
    assert motion.getNumRows() == len(run) > 3
    names, state = list(motion.getColumnLabels()), run[0].smoothed
    first = dict(zip(names, motion.getRowAtIndex(0).to_numpy(), strict=True))
    assert state is not None
    ski, helmet = state.skis["right"], state.points["P1"]
    assert ski is not None
    assert helmet is not None
    assert first["right_ski_rz"] == pytest.approx(ski.slope.value, abs=1.0)  # degrees
    assert [first[f"helmet_t{axis}"] for axis in "xyz"] == pytest.approx(
        [helmet.xyz[0], helmet.xyz[2], -helmet.xyz[1]], abs=0.05
    )


def test_the_table(measured: MeasuredRecording, folder: Path) -> None:
    with (folder / "jumper.csv").open(encoding="utf-8", newline="") as file:
        table = csv.reader(file)
        names, rows = next(table), list(table)
    assert len(set(names)) == len(names)
    assert {len(row) for row in rows} == {len(names)}
    pulses = [(jump.number, pulse) for jump in measured.jumps for pulse in jump.pulses]
    assert [(int(row[0]), int(row[1])) for row in rows] == [(number, pulse.pulse) for number, pulse in pulses]
    units = {"deg", "m", "m_per_s"}
    for i, name in enumerate(names):
        if "_sigma_" in name:
            before, unit = name.split("_sigma_")
            assert names[i - 1] == f"{before}_{unit}"
            assert unit in units
    for row, (_, pulse) in zip(rows, pulses, strict=True):
        cells = dict(zip(names, row, strict=True))
        beta = pulse.raw.angles["beta"]
        assert cells["beta_deg"] == ("" if beta is None else f"{beta.value:.5f}")
        assert pulse.smoothed is not None
        assert float(cells["velocity_s_X_m_per_s"]) == pytest.approx(pulse.smoothed.velocity.value[0], abs=1e-5)
        assert (cells["P1_status"] == "") == (pulse.raw.points["P1"] is None)


def test_files_of_a_jump_without_take_off(measured: MeasuredRecording, tmp_path: Path) -> None:
    motion_files.write(without_takeoff(measured), tmp_path)
    file = parsed((tmp_path / "jumper.c3d").read_bytes())
    assert (file.points[:, len(LABELS) :, 3] == -1).all()
    assert "SVEV:TAKEOFF_PULSE" not in file.parameters


def test_the_ends_of_a_ski_carry_the_sigma_of_its_direction() -> None:
    """Monte Carlo: 4000 draws know a standard deviation to 1.1 %, so that 5 % are more than four sigma."""
    rng = np.random.default_rng(3)
    sigma, correlation = np.radians((0.4, 0.9)), 0.3
    angles = np.radians((12.0, 8.0))
    binding = np.diag((0.01, 0.02, 0.005)) ** 2
    factor = np.linalg.cholesky(np.array(((1, correlation), (correlation, 1))) * np.outer(sigma, sigma))
    drawn = angles + rng.standard_normal((4000, 2)) @ factor.T
    tips = rng.standard_normal((4000, 3)) @ np.sqrt(binding) + HALF_SKI * directions(drawn)
    up, aside = (Quantity(float(np.degrees(a)), float(np.degrees(s))) for a, s in zip(angles, sigma, strict=True))
    ski = SkiState(directions(angles), up, aside, correlation, ("K1", "K2"), Status.TWO_RAYS)
    point = PointState(np.zeros(3), binding, ("K2", "K3"), Status.TWO_RAYS)
    state = JumperState({"P1": None, "P2": None, "P3": point, "P4": None}, {"right": ski, "left": ski}, {}, None, None)
    found = of_state(state)
    assert found.keys() == {"P3", "right_tail", "right_tip"}  # no left binding, no O
    assert found["right_tip"].xyz == pytest.approx(HALF_SKI * directions(angles))
    assert found["right_tail"].xyz == pytest.approx(-HALF_SKI * directions(angles))
    assert found["right_tip"].cameras == {"K1", "K2", "K3"}
    assert np.sqrt(np.diagonal(found["right_tip"].covariance)) == pytest.approx(tips.std(axis=0), rel=0.05)


def directions(angles: np.ndarray) -> np.ndarray:
    up, aside = angles[..., 0], angles[..., 1]
    return np.stack((np.cos(up) * np.cos(aside), np.cos(up) * np.sin(aside), np.sin(up)), axis=-1)
