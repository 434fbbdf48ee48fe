"""The file `jumper.json` (`svev-jumper/1`): written from a measured recording, and read again.

Beside the members of the contract stand those that other programs of ours need: the rate, the correlation of slope and
heading, the cameras' uncertain parameters with their covariance, the derivatives by them (six digits), the smoothed
origin, and the tests of all rays. What is not finite is written as null.
"""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.result.entries import FORMAT, decoded
from analysis.result.model import (
    CameraMove,
    Jump,
    JumperState,
    MeasuredRecording,
    OrientationResult,
    PointState,
    PulseState,
    Quantity,
    RayTest,
    SkiState,
    SmoothedState,
    TakeOff,
    Vector,
)
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, UntrustedFileError, read_whole
from rig.phrase import Phrase
from rig.transport import wire

#: Name of the file in a folder of results.
NAME: Final = "jumper.json"
_DERIVATIVE_DIGITS: Final = 6


def write(result: MeasuredRecording, path: Path) -> None:
    """Write the file; whoever reads it meanwhile finds the old one or the new one, never a part.

    Raises:
        OSError: the disk refuses.
    """
    write_json(to_json(result), path)


def write_json(content: Mapping[str, Any], path: Path) -> None:
    """Write what `to_json` has made, perhaps with more members, in the same way as `write`.

    Raises:
        OSError: the disk refuses.
    """
    replace_file(path, (json.dumps(content, allow_nan=False, ensure_ascii=False) + "\n").encode(), links=False)


def read(path: Path) -> MeasuredRecording:
    """Read the file, or the one in a folder of results.

    Raises:
        BadInputError: it is missing, unreadable, too large, or holds something else.
    """
    path = path / NAME if path.is_dir() else path
    try:
        content = read_whole(path, TEXT_MAX, links=True)
    except FileNotFoundError:
        raise BadInputError(f"{path}: no such file; name a folder that svev analyze wrote") from None
    except UntrustedFileError as error:
        raise BadInputError(f"{path}: {error.strerror}; name a folder that svev analyze wrote") from None
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    try:
        return decoded(content)
    except ValueError as error:
        raise BadInputError(f"{path}: {error}; name a {FORMAT} file as svev analyze writes it") from None


def to_json(result: MeasuredRecording) -> dict[str, Any]:
    """The content of the file, ready for `json.dumps`."""
    return {
        "format": FORMAT,
        "recording": result.recording,
        "session": dict(result.session),
        "rate_hz": result.rate_hz,
        "length_unit": "m",
        "angle_unit": "deg",
        "orientation": _orientation(result.orientation),
        "synchrony": {
            name: {
                "offset_ms": _number(o.offset_ms),
                "sigma_ms": _number(o.sigma_ms),
                "message": o.message,
                "said": _said(o.said),
            }
            for name, o in result.synchrony.items()
        },
        "jumps": [_jump(jump) for jump in result.jumps],
    }


def _orientation(orientation: OrientationResult) -> dict[str, Any]:
    return {
        "images": {
            name: {
                "X0": _list(image.position),
                "R": _list(image.rotation),
                "sigma_X0": _list(image.sigma_position),
                "sigma_angles": _list(image.sigma_angles),
            }
            for name, image in orientation.images.items()
        },
        "balls": {
            name: {
                "role": ball.role,
                "X": _list(ball.xyz),
                "sigma": _list(ball.sigma),
                "images": {camera: _list(xy) for camera, xy in ball.images.items()},
            }
            for name, ball in orientation.balls.items()
        },
        "moved": [_move(move) for move in orientation.moved],
        "messages": list(orientation.messages),
        "parameters": list(orientation.parameters),
        "covariance": _list(orientation.covariance),
        "source": orientation.source,
        "given": orientation.given,
        "given_covariance": None if orientation.given_covariance is None else _list(orientation.given_covariance),
    }


def _said(said: Phrase | None) -> Any:
    return None if said is None else wire.to_builtins(said)


def _move(move: CameraMove) -> dict[str, Any]:
    return {
        "camera": move.camera,
        "message": move.message,
        "said": _said(move.said),
        "rotation_deg": _list(move.rotation_deg),
        "shift_m": _list(move.shift_m),
        "p": _number(move.p),
    }


def _jump(jump: Jump) -> dict[str, Any]:
    return {
        "number": jump.number,
        "takeoff": None if jump.takeoff is None else _takeoff(jump.takeoff),
        "verdict": {
            "ok": bool(jump.verdict.ok),
            "message": jump.verdict.message,
            "said": [_said(each) for each in jump.verdict.said],
            "phases": {str(phase): _plain(found) for phase, found in jump.verdict.phases.items()},
        },
        "pulses": [_pulse(pulse) for pulse in jump.pulses],
        "tests": [_test(test) for test in jump.tests],
    }


def _takeoff(takeoff: TakeOff) -> dict[str, Any]:
    return {
        "pulse": float(takeoff.pulse),
        "sigma_pulses": float(takeoff.sigma_pulses),
        "time_ns": str(int(takeoff.time)),
    }


def _test(test: RayTest) -> dict[str, Any]:
    return {
        "pulse": int(test.pulse),
        "camera": test.camera,
        "what": test.what,
        "residual_px": _number(test.residual_px),
        "w": _number(test.w),
        "removed": bool(test.removed),
    }


def _pulse(pulse: PulseState) -> dict[str, Any]:
    return {
        "pulse": int(pulse.pulse),
        "time_ns": str(int(pulse.time)),
        "since_takeoff_s": _number(pulse.since_takeoff_s),
        "phase": str(pulse.phase),
        **_state(pulse.raw),
        "smoothed": None if pulse.smoothed is None else _smoothed(pulse.smoothed),
        "fates": {
            what: {"fate": str(part.fate), "images": {name: str(fate) for name, fate in part.images.items()}}
            for what, part in pulse.fates.items()
        },
    }


def _state(state: JumperState) -> dict[str, Any]:
    return {
        "points": {name: _point(point) for name, point in state.points.items()},
        "skis": {side: _ski(ski) for side, ski in state.skis.items()},
        "angles": {name: _quantity(angle) for name, angle in state.angles.items()},
        "height": _quantity(state.height),
        "speed": _quantity(state.speed),
    }


def _smoothed(state: SmoothedState) -> dict[str, Any]:
    return _state(state) | {
        "velocity": _vector(state.velocity),
        "angle_of_attack": _quantity(state.angle_of_attack),
        "origin": _vector(state.origin),
        "by_calibration": [_derivatives(row) for row in state.by_calibration],
    }


def _point(point: PointState | None) -> dict[str, Any] | None:
    if point is None or not _finite(point.xyz, point.covariance):
        return None
    return {
        "X": _list(point.xyz),
        "covariance": _list(point.covariance),
        "cameras": list(point.cameras),
        "status": str(point.status),
        **({"contradicted": True} if point.contradicted else {}),
    }


def _ski(ski: SkiState | None) -> dict[str, Any] | None:
    slope, heading = (None, None) if ski is None else (_quantity(ski.slope), _quantity(ski.heading))
    if ski is None or slope is None or heading is None:
        return None
    return {
        "direction": _list(ski.direction),
        "slope": slope,
        "heading": heading,
        "correlation": float(ski.correlation),
        "cameras": list(ski.cameras),
        "status": str(ski.status),
    }


def _quantity(quantity: Quantity | None) -> dict[str, float] | None:
    if quantity is None or not (math.isfinite(quantity.value) and math.isfinite(quantity.sigma)):
        return None
    return {"value": float(quantity.value), "sigma": float(quantity.sigma)}


def _vector(vector: Vector) -> dict[str, Any]:
    return {"value": _list(vector.value), "covariance": _list(vector.covariance)}


def _derivatives(row: Floats) -> list[float] | None:
    return [float(f"{value:.{_DERIVATIVE_DIGITS}g}") for value in row.tolist()] if _finite(row) else None


def _finite(*arrays: Floats) -> bool:
    return all(bool(np.isfinite(array).all()) for array in arrays)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _list(values: Floats) -> list[Any]:
    """Nested lists of an array; NaN and infinity become null."""
    found: list[Any] = _plain(np.asarray(values, float))
    return found


def _plain(value: Any) -> Any:
    """Anything that JSON can hold, with numpy's numbers and arrays made plain and null for what is not finite."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [_plain(each) for each in value]
    return value
