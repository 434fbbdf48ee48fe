"""From GVCP command to acknowledge."""

from dataclasses import dataclass

from rig.clocks import HostNs
from simrig.gige.control_channel import Peer
from simrig.gige.device import Device
from simrig.gige.gvcp import (
    Action,
    Command,
    Discovery,
    NotGvcpError,
    PacketResend,
    ReadMemory,
    ReadRegisters,
    RefusedError,
    Request,
    Status,
    WriteMemory,
    WriteRegisters,
    acknowledge,
    memory_ack,
    parse,
    pending,
    registers_ack,
    written_ack,
)
from simrig.gige.registers import WORD, RegisterError

_NS_PER_MS = 1_000_000


@dataclass(frozen=True, slots=True)
class Answer:
    """A datagram for the sender of a command, to be sent after a delay."""

    data: bytes
    after_ns: int = 0


class CommandHandler:
    """Serves one device. Nothing that anybody sends makes it raise."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._busy_ns = 0
        self._last: tuple[Peer, bytes] | None = None
        self._last_answers: list[Answer] = []

    def handle(self, datagram: bytes, peer: Peer, now: HostNs) -> list[Answer]:
        """What to answer to a datagram.

        A command whose acknowledge was lost comes again with the same number: it is answered, but not done, again.
        """
        try:
            request = parse(datagram)
        except NotGvcpError:
            return []
        except RefusedError as refused:
            ack = acknowledge(refused.command, refused.request_id, b"", refused.status)
            return [Answer(ack)] if refused.wants_ack else []
        self._device.control.heard(peer, now)
        if (peer, datagram) == self._last:
            return self._last_answers
        self._busy_ns = 0
        ack_data = self._do(request, peer)
        answers = self._answers(request, ack_data) if request.wants_ack and ack_data else []
        if isinstance(request.body, WriteRegisters | WriteMemory | Action):
            self._last, self._last_answers = (peer, datagram), answers
        return answers

    def _answers(self, request: Request, ack: bytes) -> list[Answer]:
        if not self._busy_ns:
            return [Answer(ack)]
        return [Answer(pending(request.request_id, self._busy_ns // _NS_PER_MS)), Answer(ack, self._busy_ns)]

    def _do(self, request: Request, peer: Peer) -> bytes | None:
        """Do it, and the acknowledge; None where there is none."""
        number, ack = request.request_id, None
        match request.body:
            case Discovery():
                ack = acknowledge(Command.DISCOVERY, number, self._device.discovery_data())
            case ReadRegisters(addresses):
                ack = self._read_registers(number, addresses, peer)
            case WriteRegisters(writes):
                ack = self._write_registers(number, writes, peer)
            case ReadMemory(address, count):
                ack = self._read_memory(number, address, count, peer)
            case WriteMemory(address, data):
                ack = self._write_memory(number, address, data, peer)
            case PacketResend(block_id, first, last):
                self._device.resend(block_id, first, last)
            case Action() as action if (status := self._device.act(action)) is not None:
                ack = acknowledge(Command.ACTION, number, b"", status)
        return ack

    def _read_memory(self, number: int, address: int, count: int, peer: Peer) -> bytes:
        try:
            return memory_ack(number, address, self._device.read(peer, address, count))
        except RegisterError as error:
            return acknowledge(Command.READMEM, number, b"", error.status)

    def _write_memory(self, number: int, address: int, data: bytes, peer: Peer) -> bytes:
        try:
            self._busy_ns = self._device.write(peer, address, data)
        except RegisterError as error:
            return written_ack(Command.WRITEMEM, number, error.done, error.status)
        return written_ack(Command.WRITEMEM, number, len(data), Status.SUCCESS)

    def _read_registers(self, number: int, addresses: tuple[int, ...], peer: Peer) -> bytes:
        values = []
        for address in addresses:
            try:
                values.append(int.from_bytes(self._device.read(peer, address, WORD), "big"))
            except RegisterError as error:
                return registers_ack(number, values, error.status)
        return registers_ack(number, values, Status.SUCCESS)

    def _write_registers(self, number: int, writes: tuple[tuple[int, int], ...], peer: Peer) -> bytes:
        for index, (address, value) in enumerate(writes):
            try:
                self._busy_ns = max(self._busy_ns, self._device.write(peer, address, value.to_bytes(WORD, "big")))
            except RegisterError as error:
                return written_ack(Command.WRITEREG, number, index, error.status)
        return written_ack(Command.WRITEREG, number, len(writes), Status.SUCCESS)
