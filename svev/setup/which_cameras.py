"""Asks which cameras there are, from left to right, by pictures of those that were found."""

from collections.abc import Callable
from typing import Final

from rig.errors import BadInputError
from rig.settings.camera import CameraSettings
from svev.setup.answers import CameraAnswer, camera_of
from svev.setup.dialog import Dialog
from svev.setup.looking import Seen
from svev.setup.search import Found
from svev.setup.words import said

_KEEP: Final = "keep"
_CAMERAS_MOST: Final = 8
#: Looks for cameras: the addresses to ask, None for all; and whether to look for FireWire ones too.
Look = Callable[[tuple[str, ...] | None, bool], Found]


class WhichCameras:
    """Asks for the cameras.

    Args:
        given: cameras that the command line names.
        today: real cameras of the rig file.
        dialog: asks.
        look: looks for cameras.
    """

    def __init__(self, given: tuple[str, ...], today: tuple[CameraSettings, ...], dialog: Dialog, look: Look) -> None:
        self._given, self._today, self._dialog, self._look = given, today, dialog, look

    def ask(self) -> tuple[tuple[CameraAnswer, ...], tuple[Seen, ...]]:
        """The cameras from left to right, and what those that answer say of themselves.

        Raises:
            BadInputError: the command line names something that is no camera, or nobody can be asked and there is none.
        """
        if self._given:
            return self._named(self._given)
        known = tuple(CameraAnswer(each.name, each.backend, _bare(each.address)) for each in self._today)
        while True:
            found = self._show(None)
            if found.cameras:
                return self._choose(found, known)
            self._dialog.say("none_found")
            if found.firewire:
                self._dialog.say("firewire", why=found.firewire)
            if not self._dialog.asks:
                if known:
                    return known, ()
                raise BadInputError("no camera answers: check power and cables, or name them by --camera ADDRESS")
            today = said(self._dialog.language, "or_keep") if known else ""
            typed = self._dialog.ask("addresses", "--camera", None, "", self._addresses, today=today)
            if typed == (_KEEP,) and known:
                return known, ()
            if typed:
                return self._named(typed)

    def _named(self, texts: tuple[str, ...]) -> tuple[tuple[CameraAnswer, ...], tuple[Seen, ...]]:
        """Cameras that were named by their addresses, whether they answer or not."""
        cameras = self._answers(texts)
        gige = tuple(each.address for each in cameras if each.backend == "aravis")
        found = self._show(gige, firewire=len(gige) < len(cameras))
        for camera in cameras:
            if not any(each.address == camera.address for each in found.cameras):
                self._dialog.say("silent", camera=camera.option)
        return self._with_regions(cameras, found), found.cameras

    def _choose(
        self, found: Found, known: tuple[CameraAnswer, ...]
    ) -> tuple[tuple[CameraAnswer, ...], tuple[Seen, ...]]:
        """The cameras of those that were found; or those of today, also if one of them does not answer now."""
        addresses = [each.address for each in found.cameras]
        silent = [each for each in known if each.address not in addresses]
        some_answer = len(silent) < len(known)
        for camera in silent if some_answer else ():
            self._dialog.say("of_today_silent", camera=camera.option)
        usual = [each.address for each in known] if some_answer else addresses[:_CAMERAS_MOST]
        shown = _KEEP if some_answer and silent else " ".join(str(addresses.index(each) + 1) for each in usual)

        def numbers(text: str) -> tuple[Seen, ...] | None:
            if text.lower() == _KEEP and known:
                return None
            words = text.replace(",", " ").split()
            chosen = [int(word) for word in words if word.isdecimal() and 1 <= int(word) <= len(addresses)]
            if not words or len(chosen) < len(words) or len(set(chosen)) < len(chosen) or len(chosen) > _CAMERAS_MOST:
                raise BadInputError(
                    f"{text}: give numbers from 1 to {len(addresses)}, each once, {_CAMERAS_MOST} at most"
                )
            return tuple(found.cameras[number - 1] for number in chosen)

        chosen = self._dialog.ask("cameras", "--camera", None, shown, numbers)
        if chosen is None:
            return known, tuple(each for each in found.cameras if each.address in {one.address for one in known})
        return self._with_regions(self._answers(tuple(each.address for each in chosen)), found), chosen

    def _show(self, addresses: tuple[str, ...] | None, *, firewire: bool = True) -> Found:
        self._dialog.say("searching")
        found = self._look(addresses, firewire)
        for number, each in enumerate(found.cameras, start=1):
            self._dialog.say("found", number=number, what=each.what)
            if each.why:
                self._dialog.say("no_picture", why=each.why)
        if found.problem:
            self._dialog.say("search_failed", why=found.problem)
        if found.page is not None and self._dialog.asks:
            self._dialog.say("pictures", page=found.page)
        return found

    def _addresses(self, text: str) -> tuple[str, ...]:
        words = tuple(text.replace(",", " ").split())
        if words != (_KEEP,):
            self._answers(words)
        return words

    def _answers(self, texts: tuple[str, ...]) -> tuple[CameraAnswer, ...]:
        """The cameras of these texts; those without a name get the first ones that are free.

        Raises:
            BadInputError: one is no camera, or two have one name or address.
        """
        cameras = [camera_of(text, self._today) for text in texts]
        taken = {each.name for each in cameras}
        free = (name for number in range(1, 2 * _CAMERAS_MOST) if (name := f"K{number}") not in taken)
        named = tuple(each if each.name else each.called(next(free)) for each in cameras)
        for values in ([each.name for each in named], [each.address for each in named]):
            for value in values:
                if values.count(value) > 1:
                    raise BadInputError(f"{value}: is there twice; give each camera a name and an address of its own")
        return named

    def _with_regions(self, cameras: tuple[CameraAnswer, ...], found: Found) -> tuple[CameraAnswer, ...]:
        """The cameras with the sizes of their sensors, as far as they tell them."""
        sizes = {each.address: (each.width, each.height) for each in found.cameras if each.width and each.height}
        return tuple(each.with_region(sizes.get(each.address)) for each in cameras)


def _bare(address: str) -> str:
    return address.lower().removeprefix("0x")
