"""The messages between the service and the process that measures the jumper."""

from pathlib import Path

from rig.api.jump import LastJump
from rig.events import Event
from rig.phrase import Phrase
from rig.settings.model import RigSettings
from rig.transport.message import Message
from rig.transport.recorder_commands import TellResult


class AnalysisConfig(Message):
    """Configuration of the analysis process.

    Attributes:
        rig: the rig; its `analysis` says where survey or calibration are.
        directory: where the logs are.
    """

    rig: RigSettings
    directory: Path


class JumpMeasured(Message):
    """A jump was measured.

    Attributes:
        jump: its main figures.
    """

    jump: LastJump


class AnalysisTold(Message):
    """Something that people should know of the analysis."""

    event: Event


class Measuring(Message):
    """Whether jumps can be measured.

    Attributes:
        refused: what is wrong with survey or poses; None: they have been read.
    """

    refused: Phrase | None = None


AnalysisReport = TellResult | JumpMeasured | AnalysisTold | Measuring
