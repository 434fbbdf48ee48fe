"""The camera's register space: typed registers over one block of memory, with access rights, limits and hooks.

This module knows no register by name; their table is `simrig.gige.registers.register_table`.
"""

import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum

from simrig.gige.protocol.gvcp import Status

Value = int | float | str
WORD = 4


class Kind(StrEnum):
    """Type of a register's value."""

    UINT = "uint"
    INT = "int"
    FLOAT = "float"
    TEXT = "text"


@dataclass(frozen=True, slots=True)
class Register:
    """One register.

    Attributes:
        length: bytes, a multiple of 4; numbers have 4 or 8.
        locked: not writable while the camera acquires.
        minimum: smallest value that may be written; None: any.
        maximum: largest value that may be written; None: any.
        increment: a written value is `minimum` plus a multiple of this.
        choices: the only values that may be written; empty: any.
    """

    name: str
    address: int
    length: int = WORD
    kind: Kind = Kind.UINT
    default: Value = 0
    writable: bool = False
    readable: bool = True
    locked: bool = False
    minimum: float | None = None
    maximum: float | None = None
    increment: int = 1
    choices: tuple[int, ...] = ()

    def decode(self, data: bytes) -> Value:
        """Value of the register's bytes."""
        match self.kind:
            case Kind.UINT | Kind.INT:
                return int.from_bytes(data, "big", signed=self.kind is Kind.INT)
            case Kind.FLOAT:
                return float(struct.unpack(">d", data)[0])
            case Kind.TEXT:
                return data.split(b"\0", 1)[0].decode("utf-8", "surrogateescape")

    def encode(self, value: Value) -> bytes:
        """The register's bytes for a value; text that is too long is cut, and holds any bytes (surrogate escapes)."""
        match self.kind:
            case Kind.UINT | Kind.INT:
                return int(value).to_bytes(self.length, "big", signed=self.kind is Kind.INT)
            case Kind.FLOAT:
                return struct.pack(">d", value)
            case Kind.TEXT:
                return str(value).encode("utf-8", "surrogateescape")[: self.length - 1].ljust(self.length, b"\0")

    def allows(self, value: Value) -> bool:
        """Whether a controller may write `value`."""
        if isinstance(value, str):
            return True
        if self.choices:
            return value in self.choices
        low = self.minimum if self.minimum is not None else value
        high = self.maximum if self.maximum is not None else value
        if not low <= value <= high:  # also refuses NaN
            return False
        return not isinstance(value, int) or (value - int(low)) % self.increment == 0


class RegisterError(Exception):
    """A read or write that the camera refuses.

    Attributes:
        status: why.
        done: bytes written before the refusal.
    """

    def __init__(self, status: Status, done: int = 0) -> None:
        super().__init__(status.name)
        self.status, self.done = status, done


class RegisterMap:
    """All registers of a camera.

    A write hook gets the value that a controller writes and returns the value to store (a command's register goes back
    to 0); it may raise `RegisterError` to refuse. A read hook returns a value that changes by itself.

    One thread serves the network. Others may call `number`, `real` and `set` at any time: each moves one slice.

    Args:
        registers: the registers; they begin at their defaults.
        documents: read-only documents by address, each a multiple of 4 bytes long.
    """

    def __init__(self, registers: Iterable[Register], documents: Mapping[int, bytes]) -> None:
        self._named = {register.name: register for register in registers}
        self._at = {
            address: register
            for register in self._named.values()
            for address in range(register.address, register.address + register.length, WORD)
        }
        self._memory = bytearray(max(self._at) + WORD)
        self._documents = dict(documents)
        self._write_hooks: dict[str, Callable[[Value], Value]] = {}
        self._read_hooks: dict[str, Callable[[], Value]] = {}
        self.locked = False
        self.reset()

    def reset(self, names: Iterable[str] | None = None) -> None:
        """Set registers (all, or those named) to their defaults without calling hooks."""
        for name in self._named if names is None else names:
            self.set(name, self._named[name].default)

    def on_write(self, name: str, hook: Callable[[Value], Value]) -> None:
        """Call `hook` when a controller writes the register."""
        self._write_hooks[name] = hook

    def on_read(self, name: str, hook: Callable[[], Value]) -> None:
        """Ask `hook` for the value when a controller reads the register."""
        self._read_hooks[name] = hook

    def __contains__(self, name: str) -> bool:
        return name in self._named

    def is_writable(self, name: str) -> bool:
        """Whether a register can be written at all."""
        return self._named[name].writable

    def address(self, name: str) -> int:
        """Address of a register."""
        return self._named[name].address

    def number(self, name: str) -> int:
        """Value of an integer register."""
        register = self._named[name]
        return int.from_bytes(self._memory[register.address : register.address + register.length], "big")

    def real(self, name: str) -> float:
        """Value of a float register."""
        return float(struct.unpack_from(">d", self._memory, self._named[name].address)[0])

    def set(self, name: str, value: Value) -> None:
        """Store a value for the camera itself, without checks or hooks."""
        register = self._named[name]
        self._memory[register.address : register.address + register.length] = register.encode(value)

    def read(self, address: int, count: int) -> bytes:
        """Read for a controller.

        Raises:
            RegisterError: the address is not aligned, has no register, or the register is not readable.
        """
        if address % WORD or count % WORD:
            raise RegisterError(Status.BAD_ALIGNMENT)
        for start, document in self._documents.items():
            if start <= address and address + count <= start + len(document):
                return document[address - start : address - start + count]
        registers = [self._at.get(word) for word in range(address, address + count, WORD)]
        if not any(registers):
            raise RegisterError(Status.INVALID_ADDRESS)
        for register in dict.fromkeys(r for r in registers if r is not None):
            if not register.readable:
                raise RegisterError(Status.ACCESS_DENIED)
            if register.name in self._read_hooks:
                self.set(register.name, self._read_hooks[register.name]())
        return bytes(self._memory[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, data: bytes) -> None:
        """Write for a controller, register by register.

        Raises:
            RegisterError: the address is not aligned, has no register, or the register refuses the value.
        """
        if address % WORD or len(data) % WORD:
            raise RegisterError(Status.BAD_ALIGNMENT)
        done = 0
        while done < len(data):
            try:
                done += self._write_register(address + done, data[done:])
            except RegisterError as error:
                raise RegisterError(error.status, done) from None

    def _write_register(self, address: int, data: bytes) -> int:
        """Write the register at `address` with its part of `data`; returns the number of bytes used."""
        register = self._at.get(address)
        if register is None:
            raise RegisterError(Status.INVALID_ADDRESS)
        if not register.writable or (register.locked and self.locked):
            raise RegisterError(Status.WRITE_PROTECT)
        whole = bytearray(self._memory[register.address : register.address + register.length])
        first = address - register.address
        part = data[: register.length - first]
        whole[first : first + len(part)] = part
        value = register.decode(bytes(whole))
        if not register.allows(value):
            raise RegisterError(Status.INVALID_PARAMETER)
        if register.name in self._write_hooks:
            value = self._write_hooks[register.name](value)
        self.set(register.name, value)
        return len(part)
