"""The GenICam features of a camera, of which every maker has others under other names.

Nothing here raises because a feature is missing or refuses a value: the caller learns it and decides what that costs.
"""

import gi

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis, GLib  # noqa: E402  (the version must be required first)


class Features:
    """Asks a camera what it has, and sets what is there.

    Args:
        device: the open camera.
    """

    def __init__(self, device: "Aravis.Device") -> None:
        self._device = device

    def close(self) -> None:
        """Let the camera go; nothing can be asked any more."""
        del self._device

    def has(self, name: str) -> bool:
        """Whether the feature is there and usable at present."""
        try:
            return bool(self._device.is_feature_available(name))
        except GLib.Error:
            return False

    def first(self, *names: str) -> str | None:
        """The first feature of these that is there."""
        return next((name for name in names if self.has(name)), None)

    def entries(self, name: str) -> list[str]:
        """Names of the values that an enumeration takes at present; empty if there is no such enumeration."""
        try:
            return list(self._device.dup_available_enumeration_feature_values_as_strings(name))
        except GLib.Error:
            return []

    def choose(self, name: str, *entries: str) -> str | None:
        """Set an enumeration to the first of these values that it takes.

        Returns:
            The value; None if there is no such feature, no such value, or the camera refuses.
        """
        there = self.entries(name)
        for entry in entries:
            if entry in there:
                try:
                    self._device.set_string_feature_value(name, entry)
                except GLib.Error:
                    continue
                return entry
        return None

    def chosen(self, name: str) -> str | None:
        """Present value of an enumeration; None if it cannot be read."""
        try:
            return str(self._device.get_string_feature_value(name))
        except GLib.Error:
            return None

    def switch(self, name: str, *, on: bool) -> bool:
        """Set a feature that is an enumeration "Off"/"On" with some makers and a boolean with others.

        Returns:
            Whether it is so now.
        """
        if not self.has(name):
            return False
        if self.entries(name):
            return self.choose(name, *(("On", "Continuous") if on else ("Off",))) is not None
        try:
            self._device.set_boolean_feature_value(name, on)
        except GLib.Error:
            return False
        return True

    def set_number(self, name: str, value: float) -> float | None:
        """Set a number, within the limits that the camera names.

        Returns:
            What the camera has made of it; None if there is no such feature, or the camera refuses.
        """
        try:
            feature = self._device.get_feature(name)
            if feature is None or not self.has(name):
                return None
            if isinstance(feature, Aravis.GcFloat):
                low, high = self._device.get_float_feature_bounds(name)
                self._device.set_float_feature_value(name, min(max(value, low), high))
                return float(self._device.get_float_feature_value(name))
            low, high = self._device.get_integer_feature_bounds(name)
            step = max(1, self._device.get_integer_feature_increment(name))
            nearest = low + round((min(max(value, low), high) - low) / step) * step
            self._device.set_integer_feature_value(name, nearest)
            return float(self._device.get_integer_feature_value(name))
        except GLib.Error:
            return None

    def bounds(self, name: str) -> tuple[int, int, int] | None:
        """Least value, largest value and step of an integer at present; None if it cannot be read."""
        try:
            if not isinstance(self._device.get_feature(name), Aravis.GcInteger) or not self.has(name):
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
            self._device.set_integer_feature_value(name, value)
        except GLib.Error:
            return False
        return True

    def number(self, name: str) -> float | None:
        """Present value of a number; None if it cannot be read."""
        try:
            feature = self._device.get_feature(name)
            if feature is None or not self.has(name):
                return None
            if isinstance(feature, Aravis.GcFloat):
                return float(self._device.get_float_feature_value(name))
            return float(self._device.get_integer_feature_value(name))
        except GLib.Error:
            return None

    def execute(self, name: str) -> bool:
        """Execute a command; whether the camera has done so."""
        try:
            if not self.has(name):
                return False
            self._device.execute_command(name)
        except GLib.Error:
            return False
        return True
