"""Modules that the launcher of this worker has imported, so that programs are forked with them.

The programs of long work import analysis once they have their priority: 0.8 CPU-seconds for each of them.
"""

from rig.transport.launcher import launcher

_ANALYSIS = (
    "analysis.digitizing.following.follow",
    "analysis.digitizing.programs.clicked_balls",
    "analysis.digitizing.programs.computing",
    "analysis.digitizing.programs.curves",
    "analysis.procedure.analyze",
    "analysis.procedure.orienting",
    "analysis.procedure.result_folder",
    "analysis.worker.findings",
)


def analysis_at_hand() -> None:
    """Have programs that measure fork with all that they import; returns at once."""
    launcher().prepare(*_ANALYSIS)
