"""What `svev ctl` says of the service's answers."""

from typing import Any


def status(answer: dict[str, Any]) -> str:
    """The status in some lines."""
    lines = [f"{answer['state']:10} {_said(answer['statement'])}"]
    for camera in answer["cameras"]:
        lines.append(f"{camera['name']:10} {_said(camera['statement'])}")
    disk = answer["disk"]
    lines.append(f"disk       {disk['free_gb']:g} GB free, {disk['jumps_left']} jumps of {disk['jump_s']:g} s left")
    if answer["preroll"]["seconds"]:
        lines.append(f"held       the last {answer['preroll']['seconds']:.1f} s")
    if answer["recording"] is not None:
        lines.append(f"recording  {recording(answer['recording'])}")
    return "\n".join(lines)


def recording(answer: dict[str, Any]) -> str:
    """One recording in a line."""
    session = answer["session"]
    who = " ".join(text for text in (session["bib"], session["athlete"]) if text)
    size = f"{answer['duration_s']:.1f} s, {answer['bytes'] / 1e6:.1f} MB"
    return f"{answer['id']}  {size:22} {_said(answer['verdict'])}" + (f"  [{who}]" if who else "")


def recordings(answer: dict[str, Any]) -> str:
    """Recordings, one a line."""
    return "\n".join(recording(each) for each in answer["recordings"]) or "no recordings"


def _said(statement: dict[str, Any]) -> str:
    return f"{statement['text']} -> {statement['advice']}" if statement["advice"] else str(statement["text"])
