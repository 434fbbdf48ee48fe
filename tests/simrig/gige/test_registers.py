"""The register space: rights, limits, hooks."""

import struct
from itertools import pairwise

import pytest

from simrig.gige.protocol.gvcp import Status
from simrig.gige.registers.register_map import Kind, Register, RegisterError, RegisterMap
from simrig.gige.registers.register_table import FIRE_TEST_PACKET, XML_ADDRESS, Identity, all_registers


@pytest.fixture
def registers() -> RegisterMap:
    return RegisterMap(
        [
            Register("Fixed", 0, default=42),
            Register("Number", 4, default=8, writable=True, minimum=4, maximum=20, increment=4),
            Register("Choice", 8, writable=True, locked=True, choices=(0, 3)),
            Register("Text", 16, 8, Kind.TEXT, "hill", writable=True),
            Register("Real", 24, 8, Kind.FLOAT, 1.5, writable=True, minimum=1.0, maximum=2.0),
            Register("Secret", 32, writable=True, readable=False),
            Register("Signed", 40, 8, Kind.INT, -5),
        ],
        {0x100: b"document"},
    )


def refused(status: Status) -> "pytest.RaisesExc[RegisterError]":
    return pytest.raises(RegisterError, match=f"^{status.name}$")


def test_defaults_are_read(registers: RegisterMap) -> None:
    assert registers.read(0, 8) == struct.pack(">II", 42, 8)
    assert registers.read(16, 8) == b"hill\0\0\0\0"
    assert registers.read(24, 8) == struct.pack(">d", 1.5)
    assert registers.read(40, 8) == struct.pack(">q", -5)
    assert registers.read(8, 12) == bytes(8) + b"hill", "what lies between registers reads as 0"
    assert registers.read(0x100, 8) == b"document"
    assert registers.read(0x104, 4) == b"ment"


@pytest.mark.parametrize(
    ("address", "count", "status"),
    [(2, 4, Status.BAD_ALIGNMENT), (0, 3, Status.BAD_ALIGNMENT), (0x1000, 4, Status.INVALID_ADDRESS),
     (0x100, 12, Status.INVALID_ADDRESS), (32, 4, Status.ACCESS_DENIED)],
)  # fmt: skip
def test_reads_that_are_refused(registers: RegisterMap, address: int, count: int, status: Status) -> None:
    with refused(status):
        registers.read(address, count)


@pytest.mark.parametrize(
    ("address", "value", "status"),
    [(0, 1, Status.WRITE_PROTECT), (4, 6, Status.INVALID_PARAMETER), (4, 24, Status.INVALID_PARAMETER),
     (8, 1, Status.INVALID_PARAMETER), (12, 1, Status.INVALID_ADDRESS), (6, 1, Status.BAD_ALIGNMENT),
     (0x100, 1, Status.INVALID_ADDRESS)],
)  # fmt: skip
def test_writes_that_are_refused(registers: RegisterMap, address: int, value: int, status: Status) -> None:
    before = registers.read(0, 48 - 16)
    with refused(status):
        registers.write(address, struct.pack(">I", value))
    assert registers.read(0, 48 - 16) == before


@pytest.mark.parametrize("value", [float("nan"), 0.5, 2.5])
def test_floats_outside_their_limits_are_refused(registers: RegisterMap, value: float) -> None:
    with refused(Status.INVALID_PARAMETER):
        registers.write(24, struct.pack(">d", value))


def test_one_write_may_reach_over_several_registers(registers: RegisterMap) -> None:
    registers.write(4, struct.pack(">II", 12, 3))
    assert (registers.number("Number"), registers.number("Choice")) == (12, 3)
    with pytest.raises(RegisterError) as error:
        registers.write(4, struct.pack(">II", 16, 99))
    assert error.value.done == 4, "the first one was written"
    assert registers.number("Number") == 16


def test_half_of_a_long_register_may_be_written(registers: RegisterMap) -> None:
    registers.write(20, b"top\0")
    assert registers.read(16, 8) == b"hilltop\0"


def test_locked_registers(registers: RegisterMap) -> None:
    registers.locked = True
    registers.write(4, struct.pack(">I", 12))
    with refused(Status.WRITE_PROTECT):
        registers.write(8, struct.pack(">I", 3))


def test_hooks(registers: RegisterMap) -> None:
    written = []
    registers.on_write("Number", lambda value: written.append(value) or 0)  # type: ignore[func-returns-value]
    registers.on_read("Fixed", lambda: 43)
    registers.write(4, struct.pack(">I", 16))
    assert written == [16]
    assert registers.read(0, 8) == struct.pack(">II", 43, 0)


def test_reset(registers: RegisterMap) -> None:
    registers.write(4, struct.pack(">II", 12, 3))
    registers.reset(["Number"])
    assert (registers.number("Number"), registers.number("Choice")) == (8, 3)
    registers.reset()
    assert registers.number("Choice") == 0


def test_no_two_registers_of_the_camera_overlap() -> None:
    identity = Identity("SIM", "K1", 0x7F00000B, (1936, 1216), 10**9, resend=True)
    table = sorted(all_registers(identity, 100), key=lambda register: register.address)
    for first, second in pairwise(table):
        assert first.address + first.length <= second.address, (first.name, second.name)
    assert table[-1].address < XML_ADDRESS
    assert next(r for r in table if r.name == "GevSCPS").default < FIRE_TEST_PACKET  # type: ignore[operator]
