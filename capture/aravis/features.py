"""The GenICam features of a camera, of which every maker has others under other names.

Nothing here raises because a feature is missing or refuses a value: the caller learns it and decides what that costs.
"""

import ctypes
import math
import re
from contextlib import suppress
from typing import Final

from capture.aravis.library import Aravis, GLib

#: Nodes of a description that may bear the name of a feature, and are none: makers name categories "Gain".
_NO_FEATURES: Final = (Aravis.GcCategory, Aravis.GcPort)


#: A step of a number that is smaller is none: Aravis has the least number of all for it.
_NO_STEP: Final = 1e-12
_ON: Final = ("On", "Continuous", "True", "Enable", "Enabled")
_OFF: Final = ("Off", "False", "Disable", "Disabled")


class Features:
    """Asks a camera what it has, and sets what is there.

    Args:
        device: the open camera.
    """

    def __init__(self, device: "Aravis.Device") -> None:
        self._device = device
        self._before: list[tuple[str, float | str | bool]] = []

    def remember(self, name: str) -> None:
        """Note the present value of a feature that is about to be written, if it can be read."""
        value = self._value(name)
        if value is not None:
            self._before.append((name, value))

    def set_back(self) -> None:
        """Write the values from before, the latest first, so that selectors select the same as then."""
        while self._before:
            name, value = self._before.pop()
            with suppress(GLib.Error):  # it was not to be written now, or it is no longer there
                self._write(name, value)

    def _value(self, name: str) -> float | str | bool | None:
        feature = self._device.get_feature(name)
        try:
            if isinstance(feature, Aravis.GcBoolean):
                return bool(self._device.get_boolean_feature_value(name))
        except GLib.Error:
            return None
        return self.chosen(name) if isinstance(feature, Aravis.GcEnumeration) else self.number(name)

    def _write(self, name: str, value: float | str | bool) -> None:
        """Write a feature by its kind."""
        if isinstance(value, bool):
            self._device.set_boolean_feature_value(name, value)
        elif isinstance(value, str):
            self._device.set_string_feature_value(name, value)
        elif isinstance(self._device.get_feature(name), Aravis.GcFloat):
            self._device.set_float_feature_value(name, value)
        else:
            self._device.set_integer_feature_value(name, int(value))

    def close(self) -> None:
        """Let the camera go; nothing can be asked any more."""
        del self._device

    def has(self, name: str) -> bool:
        """Whether the feature is there and usable at present; a category of that name is none."""
        try:
            if isinstance(self._device.get_feature(name), _NO_FEATURES):
                return False
            return bool(self._device.is_feature_available(name))
        except GLib.Error:
            return False

    def first_number(self, *names: str) -> str | None:
        """The first of these that is a number."""
        return next((name for name in names if self._is_number(name)), None)

    def _is_number(self, name: str) -> bool:
        feature = self._device.get_feature(name)
        return (
            isinstance(feature, Aravis.GcFloat | Aravis.GcInteger)
            and not isinstance(feature, Aravis.GcEnumeration | Aravis.GcBoolean)
            and self.has(name)
        )

    def entries(self, name: str) -> list[str]:
        """Names of the values that an enumeration takes at present; empty if there is no such enumeration."""
        try:
            return list(self._device.dup_available_enumeration_feature_values_as_strings(name))
        except GLib.Error:
            return []

    def choose(self, name: str, *entries: str) -> str | None:
        """Set an enumeration to the first of these values that it takes, or already has.

        Makers write the same name as RisingEdge, Rising_Edge or RISINGEDGE.

        Returns:
            The value, as it was asked for; None if there is no such feature, no such value, or the camera refuses.
        """
        there = {_plain(entry): entry for entry in self.entries(name)}
        known = ((entry, there[_plain(entry)]) for entry in entries if _plain(entry) in there)
        return next((entry for entry, its in known if self._becomes(name, its)), None)

    def _becomes(self, name: str, entry: str) -> bool:
        """Set an enumeration that has the value not already: many can only be read, or have one value."""
        if self.chosen(name) == entry:
            return True
        self.remember(name)
        try:
            self._write(name, entry)
        except GLib.Error:
            return False
        return self.chosen(name) in {entry, None}  # some cannot be read back

    def chosen(self, name: str) -> str | None:
        """Present value of an enumeration; None if it cannot be read."""
        try:
            if not isinstance(self._device.get_feature(name), Aravis.GcEnumeration):
                return None
            value = self._device.get_string_feature_value(name)
        except GLib.Error:
            return None
        return None if value is None else str(value)

    def switch(self, name: str, *, on: bool) -> bool:
        """Set a feature that is an enumeration "Off"/"On" with some makers, a boolean or a number with others.

        Returns:
            Whether it is so now.
        """
        if not self.has(name):
            return False
        if self.entries(name):
            return self.choose(name, *(_ON if on else _OFF)) is not None
        if self._is_number(name):
            return self.set_number(name, on) == on
        try:
            if bool(self._device.get_boolean_feature_value(name)) != on:
                self.remember(name)
                self._write(name, on)
            return bool(self._device.get_boolean_feature_value(name)) == on
        except GLib.Error:
            return False

    def set_number(self, name: str, value: float, *, up_to: bool = False) -> float | None:
        """Set a number, within the limits and steps that the camera names, unless it is so already.

        Args:
            name: of the feature.
            value: what it should be.
            up_to: of an integer's steps the next lower one is taken, not the nearest.

        Returns:
            What it is now; None if there is no such number, or the camera refuses and it is another one.
        """
        if self.number(name) == value:  # many can only be read, and are right
            return float(value)
        try:
            if not self._is_number(name):
                return None
            value = self._possible(name, value, up_to=up_to)
            if self.number(name) != value:
                self.remember(name)
                self._write(name, value)
        except GLib.Error:
            return None
        return self.number(name)

    def _possible(self, name: str, value: float, *, up_to: bool) -> float:
        """The value within the limits and steps of a number that is nearest to one, or next below it."""
        if isinstance(self._device.get_feature(name), Aravis.GcFloat):
            low, high = self._device.get_float_feature_bounds(name)
            value, step = min(max(value, low), high), self._float_step(name)
            if step > 0:
                value = low + step * min(round((value - low) / step), math.floor((high - low) / step))
            return float(value)
        low, high = self._device.get_integer_feature_bounds(name)
        step = max(1, self._device.get_integer_feature_increment(name))
        steps = (min(max(value, low), high) - low) / step
        return int(low + min(math.floor(steps) if up_to else round(steps), (high - low) // step) * step)

    def _float_step(self, name: str) -> float:
        """Step of a float; 0 if it has none, as most."""
        try:
            step = float(self._device.get_float_feature_increment(name))
        except GLib.Error:  # there is no such node
            return 0.0
        return step if step > _NO_STEP else 0.0

    def unit(self, name: str) -> str:
        """Unit of a number; empty if none is told."""
        return str(self._device.get_feature(name).get_unit() or "") if self._is_number(name) else ""

    def least(self, name: str) -> float | None:
        """Least value of a number at present; None if it cannot be read."""
        try:
            if not self._is_number(name):
                return None
            if isinstance(self._device.get_feature(name), Aravis.GcFloat):
                return float(self._device.get_float_feature_bounds(name)[0])
            return float(self._device.get_integer_feature_bounds(name)[0])
        except GLib.Error:
            return None

    def bounds(self, name: str) -> tuple[int, int, int] | None:
        """Least value, largest value and step of an integer at present; None if it cannot be read."""
        try:
            if not self._is_number(name) or isinstance(self._device.get_feature(name), Aravis.GcFloat):
                return None
            low, high = self._device.get_integer_feature_bounds(name)
            return int(low), int(high), max(1, int(self._device.get_integer_feature_increment(name)))
        except GLib.Error:
            return None

    def write(self, name: str, value: int) -> bool:
        """Write an integer as it is, without reading it back: keys can only be written with some makers.

        Returns:
            Whether the camera has taken it.
        """
        try:
            if not self.has(name):
                return False
            self.remember(name)
            self._write(name, value)
        except GLib.Error:
            return False
        return True

    def number(self, name: str) -> float | None:
        """Present value of a number; None if it cannot be read."""
        try:
            return self.measured(name)
        except GLib.Error:
            return None

    def measured(self, name: str) -> float | None:
        """Present value of a number; None if it is not there at present.

        Raises:
            GLib.Error: the camera does not answer, or refuses.
        """
        if not self._is_number(name):
            return None
        if isinstance(self._device.get_feature(name), Aravis.GcFloat):
            return float(self._device.get_float_feature_value(name))
        return float(self._device.get_integer_feature_value(name))

    def execute(self, name: str) -> bool:
        """Execute a command; whether the camera has done so."""
        try:
            if not self.has(name):
                return False
            self._device.execute_command(name)
        except GLib.Error:
            return False
        return True


def _plain(entry: str) -> str:
    """A name of an enumeration's value without capitals and signs."""
    return re.sub(r"[^a-z0-9]", "", entry.lower())


def text_at(device: "Aravis.Device", address: int, length: int) -> str:
    """Text in a camera's memory, whatever bytes it holds: Aravis hands out UTF-8 alone.

    Raises:
        GLib.Error: the camera does not answer, or has nothing there.
    """
    memory = ctypes.create_string_buffer(length)
    device.read_memory(address, length, ctypes.addressof(memory))
    return memory.raw.split(b"\0")[0].decode(errors="replace")
