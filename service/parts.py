"""How recordings are split into parts: changed from the next recording on, kept in the rig file."""

from dataclasses import replace
from functools import partial
from pathlib import Path

from rig.api.parts import PartsChange, PartsView
from rig.phrase import Phrase, phrase
from rig.settings.editing import written_parts
from rig.settings.model import RecorderSettings
from service.rig_file import keep
from service.supervision.messages import ChangeParts
from service.supervision.supervisor import Supervisor


class PartLimits:
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        rig_file: where the limits are kept.
    """

    def __init__(self, supervisor: Supervisor, rig_file: Path) -> None:
        self._supervisor, self._file = supervisor, rig_file
        self._kept = _limits(supervisor.rig.recorder)

    def view(self) -> PartsView:
        """How recordings are split from the next one on."""
        part_s, part_gb = now = _limits(self._supervisor.rig.recorder)
        return PartsView(part_s=part_s, part_gb=part_gb, saved=now == self._kept)

    def change(self, change: PartsChange) -> PartsView:
        """Change the limits, and write them into the rig file if that is wished.

        Raises:
            StorageError: the rig file cannot be written; the limits are changed all the same.
        """
        with self._supervisor.changing:
            in_use = self._supervisor.now.in_use
            limits = change.model_dump(include=change.model_fields_set & {"part_s", "part_gb"})
            recorder = in_use.rig.recorder.model_copy(update=limits)
            part_s, part_gb = _limits(recorder)
            if recorder != in_use.rig.recorder:
                rig = in_use.rig.model_copy(update={"recorder": recorder})
                new = replace(in_use, rig=rig, toml=written_parts(in_use.toml, part_s, part_gb))
                text = "recordings are split from the next one on: {limits}"
                said = phrase("event_parts", text, limits=_in_words(part_s, part_gb))
                self._supervisor.change(partial(ChangeParts, new=new), "recorder", said)
            if change.save:
                self._keep(part_s, part_gb)
            return self.view()

    def _keep(self, part_s: float | None, part_gb: float | None) -> None:
        by_hand = phrase("keep_parts", "change part_s and part_gb under [recorder] in it")
        keep(self._file, lambda text: written_parts(text, part_s, part_gb), by_hand)
        self._kept = part_s, part_gb


def _limits(recorder: RecorderSettings) -> tuple[float | None, float | None]:
    return recorder.part_s, recorder.part_gb


def _in_words(part_s: float | None, part_gb: float | None) -> Phrase:
    if part_s is not None and part_gb is not None:
        text = "after {seconds:g} s, or before a log is larger than {gb:g} GB"
        return phrase("parts_by_both", text, seconds=part_s, gb=part_gb)
    if part_s is not None:
        return phrase("parts_by_time", "after {seconds:g} s", seconds=part_s)
    if part_gb is not None:
        return phrase("parts_by_size", "before a log is larger than {gb:g} GB", gb=part_gb)
    return phrase("parts_never", "never")
