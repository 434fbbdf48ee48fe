"""The questions, in their order; each takes the answer of the command line, or that of today as its default."""

import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from analysis.scene.survey import read_survey
from rig.errors import BadInputError
from rig.host.disk import free_bytes
from rig.host.interfaces import interface_to, own_interfaces
from rig.settings.camera import Backend
from rig.settings.trigger import GpioTrigger, TriggerBoxTrigger
from svev.doctor.disk import existing_part
from svev.serving.certificates import check_name
from svev.setup.answers import SOURCES, Answers, CameraAnswer, Language, Source, Today
from svev.setup.dialog import Dialog
from svev.setup.looking import Seen
from svev.setup.places import Places
from svev.setup.which_cameras import Look, WhichCameras
from svev.setup.words import said

_NONE: Final = frozenset({"none", "ingen", ""})
_LANGUAGES: Final[dict[str, Language]] = {"en": "en", "nb": "nb", "english": "en", "norsk": "nb", "engelsk": "en"}
#: Sources whose commands only cameras of one back end take.
_COMMANDS: Final[dict[Source, Backend]] = {"action": "aravis", "iidc-broadcast": "iidc"}
_RATE_HZ: Final = 30.0
_RATES_HZ: Final = (0.1, 1000.0)
_NAME_MAX: Final = 80
_JUMBO: Final = 9000


@dataclass(frozen=True, slots=True)
class Given:
    """The answers of the command line; None: not given there."""

    language: str | None = None
    name: str | None = None
    cameras: tuple[str, ...] = ()
    trigger: str | None = None
    rate: str | None = None
    input: str | None = None
    port: str | None = None
    line: str | None = None
    survey: str | None = None
    recordings: str | None = None
    phones: bool | None = None
    call: tuple[str, ...] = ()
    https: bool | None = None


class Interview:
    """Asks everything.

    Args:
        given: what the command line answers.
        today: what the files say.
        places: where the files go.
        dialog: asks.
        look: looks for cameras.
    """

    def __init__(self, given: Given, today: Today, places: Places, dialog: Dialog, look: Look) -> None:
        self._given, self._today, self._places, self._dialog, self._look = given, today, places, dialog, look

    def ask(self) -> Answers:
        """All answers.

        Raises:
            BadInputError: an answer on the command line is wrong, or there is none and nobody to ask.
            KeyboardInterrupt: who is asked has left.
        """
        given, dialog, rig = self._given, self._dialog, self._today.rig
        usual = "nb" if os.environ.get("LANG", "").startswith(("nb", "nn", "no")) else "en"
        language = dialog.language = dialog.ask("language", "--language", given.language, usual, _language)
        if dialog.asks:
            dialog.say("begin")
        dialog.say("files_in", folder=self._places.folder)
        name = dialog.ask("name", "--name", given.name, rig.name if rig else "hill", _name)
        cameras, seen = WhichCameras(given.cameras, self._today.cameras, dialog, self._look).ask()
        source, rate_hz, port, line = self._trigger(cameras)
        by_cable = source in {"external", "triggerbox", "gpio"} and any(each.backend == "aravis" for each in cameras)
        trigger_input = self._input(seen) if by_cable else None
        survey = self._survey(cameras)
        recordings = dialog.ask("recordings", "--recordings", given.recordings, self._recordings(), _folder)
        dialog.say("free", free=(free_bytes(existing_part(recordings)) or 0) / 1e9)
        phones, names, https = self._phones(cameras)
        sizes = [each.packet_size for each in seen if each.packet_size]
        wanted = rig.network.packet_size if rig else _JUMBO
        return Answers(
            language=language, name=name, cameras=cameras, source=source, rate_hz=rate_hz, input=trigger_input,
            port=port, line=line, survey=survey, recordings=recordings, phones=phones, names=names, https=https,
            packet_size=min(sizes) if sizes and min(sizes) < wanted else None,
        )  # fmt: skip

    def _trigger(self, cameras: tuple[CameraAnswer, ...]) -> tuple[Source, float, str | None, str | None]:
        """Who makes the pulses, how many a second, and by which port or line."""

        def check(text: str) -> Source:
            source = _source(text)
            if source in _COMMANDS and any(each.backend != _COMMANDS[source] for each in cameras):
                raise BadInputError(f"{source}: not all of these cameras take such commands; give another one")
            return source

        given, dialog, rig = self._given, self._dialog, self._today.rig
        if given.trigger is None and dialog.asks:
            for text in said(dialog.language, "trigger_list").split("\n"):
                dialog.plain(text)
        usual = rig.trigger.source if rig else "external"
        source = dialog.ask("trigger", "--trigger", given.trigger, usual, check)
        rate = f"{rig.trigger.rate_hz if rig else _RATE_HZ:g}"
        rate_hz = dialog.ask("rate", "--rate", given.rate, rate, _rate)
        port = line = None
        if source == "triggerbox":
            usual_port = rig.trigger.port if rig and isinstance(rig.trigger, TriggerBoxTrigger) else "/dev/svev-trigger"
            port = dialog.ask("port", "--trigger-port", given.port, usual_port, _text)
        if source == "gpio":
            usual_line = str(rig.trigger.line) if rig and isinstance(rig.trigger, GpioTrigger) else None
            line = dialog.ask("line", "--trigger-line", given.line, usual_line, _text)
        return source, rate_hz, port, line

    def _input(self, seen: tuple[Seen, ...]) -> str:
        """The input of the cameras that the cable leads to, one that all of them have."""
        told = [each.inputs for each in seen if each.inputs]
        common = [name for name in told[0] if all(name in each for each in told)] if told else []
        before = [camera.trigger_input for camera in self._today.cameras if camera.backend == "aravis"]
        usual = before[0] if before and (before[0] in common or not common) else (common or ["Line1"])[0]
        inputs = said(self._dialog.language, "inputs", list=", ".join(common)) if common else ""

        def check(text: str) -> str:
            if common and text not in common:
                raise BadInputError(f"{text}: the cameras have {', '.join(common)}; give one of these")
            return _text(text)

        return self._dialog.ask("input", "--trigger-input", self._given.input, usual, check, inputs=inputs)

    def _survey(self, cameras: tuple[CameraAnswer, ...]) -> Path | None:
        """The survey, read to see whether it can be."""
        rig, dialog = self._today.rig, self._dialog
        before = rig.analysis.survey if rig and rig.analysis else None
        none = said(dialog.language, "none")

        def check(text: str) -> Path | None:
            if text.lower() in _NONE:
                return None
            survey = read_survey(path := Path(text).expanduser())
            for camera in cameras:
                if not survey.has(camera.name):
                    raise BadInputError(survey.lacks(camera.name))
            there = ", ".join(camera.name for camera in survey.network.cameras)
            dialog.say("surveyed", points=len(survey.surveyed().names), cameras=there)
            return path

        return dialog.ask("survey", "--survey", self._given.survey, str(before) if before else none, check)

    def _recordings(self) -> str:
        rig = self._today.rig
        if rig is None or "directory" not in rig.recorder.model_fields_set:
            return str(self._places.recordings)
        # A relative folder is one in the folder where the service works.
        return str((self._places.state or Path.cwd()) / rig.recorder.directory)

    def _phones(self, cameras: tuple[CameraAnswer, ...]) -> tuple[bool, tuple[str, ...], bool]:
        """Whether other computers reach the page, by which names, and whether by HTTPS."""
        given, dialog, today = self._given, self._dialog, self._today.options
        if not dialog.confirm("phones", given.phones, default=today.phones or self._today.rig is None):
            return False, (), False
        usual = ", ".join(today.names) or ", ".join(_own_names(cameras))
        names = dialog.ask("call", "--call", ", ".join(given.call) or None, usual, _names)
        return True, names, dialog.confirm("https", given.https, default=today.https or not today.phones)


def _own_names(cameras: tuple[CameraAnswer, ...]) -> list[str]:
    """The name of this computer in its network, and its addresses at ports that lead to no camera."""
    gige = [each.address for each in cameras if each.backend == "aravis"]
    busy = {port.name for address in gige if (port := interface_to(address)) is not None}
    ports = [each for each in own_interfaces() if not each.network.is_loopback and each.name not in busy]
    return [f"{socket.gethostname().partition('.')[0]}.local", *dict.fromkeys(str(each.address) for each in ports)]


def _language(text: str) -> Language:
    if text.lower() not in _LANGUAGES:
        raise BadInputError(f"{text}: give en (English) or nb (Norwegian)")
    return _LANGUAGES[text.lower()]


def _name(text: str) -> str:
    if not 0 < len(text) <= _NAME_MAX or not text.isprintable():
        raise BadInputError(f"{text}: give a name of 1 to {_NAME_MAX} characters")
    return text


def _source(text: str) -> Source:
    for source in SOURCES:
        if text.lower() == source:
            return source
    raise BadInputError(f"{text}: give one of {', '.join(SOURCES)}")


def _rate(text: str) -> float:
    try:
        rate_hz = float(text.replace(",", "."))
    except ValueError:
        rate_hz = 0.0
    if not _RATES_HZ[0] <= rate_hz <= _RATES_HZ[1]:
        raise BadInputError(f"{text}: give a number from {_RATES_HZ[0]:g} to {_RATES_HZ[1]:g}, e.g. {_RATE_HZ:g}")
    return rate_hz


def _text(text: str) -> str:
    if not text:
        raise BadInputError("an empty answer: give one")
    return text


def _folder(text: str) -> Path:
    """A folder that can be written, or be made; it is not made now."""
    path = Path(_text(text)).expanduser().absolute()
    there = existing_part(path)
    if not there.is_dir():
        raise BadInputError(f"{path}: {there} is no folder; name another one")
    if not os.access(there, os.W_OK | os.X_OK):
        raise BadInputError(f"{path}: {there} cannot be written by you; name another folder, or call svev with sudo")
    return path


def _names(text: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(text.replace(",", " ").split()))
    if not names:
        raise BadInputError("no name: give one like hillpc.local, or an address")
    for name in names:
        check_name(name)
    return names
