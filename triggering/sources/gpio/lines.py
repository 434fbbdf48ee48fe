"""Opens GPIO chips and requests their lines; every refusal is one line that says what to do."""

import errno
import os
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import gpiod
from gpiod.line import Direction, Edge, Value

from rig.clocks import HostNs
from rig.errors import TriggerError
from rig.phrase import phrase
from rig.settings.trigger import GpioLine

_DEVICES: Final = Path("/dev")
#: Who has a line, as `gpioinfo` shows it.
CONSUMER: Final = "svev"


def chip_path(chip: str, devices: Path = _DEVICES) -> Path:
    """Device file of a chip.

    Args:
        chip: the file, its name, its number, or the chip's label as `gpiodetect` shows it.
        devices: folder of the device files.

    Raises:
        TriggerError: there is no such chip, or several have this label.
    """
    direct = devices / (f"gpiochip{chip}" if chip.isdecimal() else chip)  # an absolute path stays as it is
    if direct.exists() or "/" in chip:
        return direct
    there = sorted(path for path in devices.glob("gpiochip*") if gpiod.is_gpiochip_device(str(path)))
    labelled = [path for path in there if _label(path) == chip]
    if len(labelled) > 1:
        text = "GPIO chip {chip}: {chips} have this label: name one of them as trigger.chip in the rig file"
        raise TriggerError(phrase("gpio_two_chips", text, chip=chip, chips=", ".join(path.name for path in labelled)))
    if not labelled:
        raise _missing(chip)
    return labelled[0]


def open_chip(path: Path) -> gpiod.Chip:
    """Open a chip; the caller closes it.

    Raises:
        TriggerError: it is missing, no GPIO chip, or may not be opened.
    """
    try:
        return gpiod.Chip(str(path))
    except FileNotFoundError:
        raise _missing(str(path)) from None
    except PermissionError:
        text = (
            "GPIO chip {chip} may not be opened by this user: sudo usermod -aG gpio $USER and log in again; without a "
            "group gpio, make one and a udev rule for it (docs/how-to/hill-pc.md)"
        )
        raise TriggerError(phrase("gpio_not_permitted", text, chip=str(path))) from None
    except OSError as error:
        text = (
            "GPIO chip {chip} cannot be opened ({why}): name one that gpiodetect lists as trigger.chip in the rig file"
        )
        raise TriggerError(phrase("gpio_no_chip", text, chip=str(path), why=_why(error))) from None


def consumer_of(chip: str, line: GpioLine) -> str:
    """Who has a line; empty: nobody. The line is left as it is.

    Args:
        chip: its chip, as the rig file names it.
        line: number or name.

    Raises:
        TriggerError: there is no such chip or line, or the chip may not be opened.
    """
    path = chip_path(chip)
    with open_chip(path) as opened:
        info = opened.get_line_info(_offset(opened, path, line))
    return (info.consumer or "?") if info.used else ""


class RequestedLine:
    """A line that this process has; a context manager that gives it back. Levels may be asked for in any thread.

    Args:
        chip: its chip, as the rig file names it.
        line: number or name.
        settings: how it is to be used.

    Raises:
        TriggerError: there is no such chip or line, somebody else has the line, or it may not be used.
    """

    def __init__(self, chip: str, line: GpioLine, settings: gpiod.LineSettings) -> None:
        self._path = chip_path(chip)
        with open_chip(self._path) as opened:
            self.offset = _offset(opened, self._path, line)
            self.name = f"line {line} of {self._path.name}"
            try:
                self.request = opened.request_lines({self.offset: settings}, consumer=CONSUMER)
            except OSError as error:
                raise _refused(opened, self.offset, self.name, error) from None

    def __enter__(self) -> Self:
        return self

    def active(self) -> bool:
        """Whether the line is active now; an input, after its debounce period.

        Raises:
            TriggerError: the chip is gone.
        """
        try:
            return self.request.get_value(self.offset) is Value.ACTIVE
        except OSError as error:
            raise _gone(self.name, error) from None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.request.release()


class OutputLine(RequestedLine):
    """A line that is set; it is inactive from its request on, and again before it is given back.

    Args:
        chip: its chip, as the rig file names it.
        line: number or name.
        active_low: low is active.

    Raises:
        TriggerError: as `RequestedLine`.
    """

    def __init__(self, chip: str, line: GpioLine, *, active_low: bool) -> None:
        settings = gpiod.LineSettings(
            direction=Direction.OUTPUT, active_low=active_low, output_value=Value.INACTIVE
        )  # fmt: skip
        super().__init__(chip, line, settings)

    def set(self, active: bool) -> None:
        """Set the line.

        Raises:
            TriggerError: the chip is gone.
        """
        try:
            self.request.set_value(self.offset, Value.ACTIVE if active else Value.INACTIVE)
        except OSError as error:
            raise _gone(self.name, error) from None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None or not issubclass(kind, TriggerError):  # a chip that is gone sets nothing
                self.set(False)
        finally:
            super().__exit__(kind, error, trace)


class InputLine(RequestedLine):
    """A line whose level is asked for.

    Args:
        chip: its chip, as the rig file names it.
        line: number or name.
        active_low: low is active.

    Raises:
        TriggerError: as `RequestedLine`.
    """

    def __init__(self, chip: str, line: GpioLine, *, active_low: bool) -> None:
        super().__init__(chip, line, gpiod.LineSettings(direction=Direction.INPUT, active_low=active_low))


class EdgeLine(RequestedLine):
    """A line whose edges to active are told.

    Args:
        chip: its chip, as the rig file names it.
        line: number or name.
        active_low: low is active.
        debounce_ms: a level counts when it has lasted so long; 0: at once.

    Raises:
        TriggerError: as `RequestedLine`.
    """

    def __init__(self, chip: str, line: GpioLine, *, active_low: bool, debounce_ms: float) -> None:
        settings = gpiod.LineSettings(
            direction=Direction.INPUT,
            active_low=active_low,
            edge_detection=Edge.RISING,
            debounce_period=timedelta(milliseconds=debounce_ms),
        )
        super().__init__(chip, line, settings)

    def fileno(self) -> int:
        """Descriptor that is readable when there are edges."""
        return self.request.fd

    def edges(self) -> list[HostNs]:
        """When the edges came that have not been told yet, and lasted; waits for one if there are none.

        Raises:
            TriggerError: the chip is gone.
        """
        try:
            return [HostNs(event.timestamp_ns) for event in self.request.read_edge_events()]
        except OSError as error:
            raise _gone(self.name, error) from None


def _label(path: Path) -> str:
    try:
        with gpiod.Chip(str(path)) as chip:
            return chip.get_info().label
    except OSError:
        return ""  # one that may not be opened is found by its name only


def _missing(chip: str) -> TriggerError:
    text = "GPIO chip {chip} is not there: name one that gpiodetect lists as trigger.chip in the rig file"
    return TriggerError(phrase("gpio_chip_missing", text, chip=chip))


def _offset(chip: gpiod.Chip, path: Path, line: GpioLine) -> int:
    last = chip.get_info().num_lines - 1
    try:
        return chip.line_offset_from_id(line)
    except (OSError, ValueError):
        text = (
            "GPIO chip {chip} has no line {line}, but lines 0 to {last}: name one that gpioinfo lists in the rig file"
        )
        raise TriggerError(phrase("gpio_no_line", text, chip=str(path), line=line, last=last)) from None


def _refused(chip: gpiod.Chip, offset: int, name: str, error: OSError) -> TriggerError:
    if error.errno == errno.EBUSY:
        consumer = chip.get_line_info(offset).consumer or "?"
        text = "{line} is taken by {consumer}: end that, or name another line in the rig file"
        return TriggerError(phrase("gpio_taken", text, line=name, consumer=consumer))
    text = "{line} cannot be used so ({why}): name another line in the rig file"
    return TriggerError(phrase("gpio_refused", text, line=name, why=_why(error)))


def _gone(name: str, error: OSError) -> TriggerError:
    text = "{line} fails ({why}): see that its GPIO chip is plugged in"
    return TriggerError(phrase("gpio_gone", text, line=name, why=_why(error)))


def _why(error: OSError) -> str:
    return os.strerror(error.errno or errno.EIO)
