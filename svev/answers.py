"""Answers of the service as lines for people, for `svev ctl`."""

from typing import Any


def status_lines(answer: dict[str, Any]) -> list[str]:
    """The status, for people: state, cameras, disk, seconds held, recording in progress."""
    lines = [f"{answer['state']:10} {_said(answer['statement'])}"]
    for camera in answer["cameras"]:
        lines.append(f"{camera['name']:10} {_said(camera['statement'])}")
    disk = answer["disk"]
    trash = f" and {disk['trash_gb']:g} GB in the trash" if disk["trash_gb"] else ""
    left = f"{disk['jumps_left']} jumps of {disk['jump_s']:g} s left"
    lines.append(f"disk       {disk['free_gb']:g} GB free{trash}, {left}")
    if answer["preroll"]["seconds"]:
        lines.append(f"held       the last {answer['preroll']['seconds']:.1f} s")
    if answer["recording"] is not None:
        lines.append(f"recording  {_recording_line(answer['recording'])}")
    measuring = answer["measuring"]
    if measuring["recording"] is not None or measuring["waiting"]:
        now = f"{measuring['recording']} ({measuring['state']})" if measuring["recording"] else "nothing"
        lines.append(f"measuring  {now}, {measuring['waiting']} waiting")
    return lines


def recording_lines(answer: dict[str, Any]) -> list[str]:
    """One recording, for people."""
    return [_recording_line(answer)]


def _recording_line(answer: dict[str, Any]) -> str:
    """One recording, for people."""
    session = answer["session"]
    who = " ".join(text for text in (session["bib"], session["athlete"]) if text)
    size = f"{answer['duration_s']:.1f} s, {answer['bytes'] / 1e6:.1f} MB"
    return f"{answer['id']}  {size:22} {_said(answer['verdict'])}" + (f"  [{who}]" if who else "")


def measurement_lines(answer: dict[str, Any]) -> list[str]:
    """What was measured in a recording, for people: its state, then a line for each jump."""
    words = {"waiting": f"waiting, {answer['before']} before it", "none": "not measured"}
    state = words.get(answer["state"], answer["state"])
    problem = answer["problem"]
    lines = [f"{answer['recording']}: {state}" + ("" if problem is None else f": {problem['text']}")]
    lines += [f"jump {jump['jump']}: {jump['verdict']}" for jump in answer["figures"]]
    return lines + ([f"files: {', '.join(answer['files'])}"] if answer["files"] else [])


def recordings_lines(answer: dict[str, Any]) -> list[str]:
    """Recordings, for people, one a line."""
    return [_recording_line(each) for each in answer["recordings"]] or ["no recordings"]


def jumper_lines(answer: dict[str, Any]) -> list[str]:
    """The next jumper, for people."""
    fields = answer["session"] | answer["more"]
    return ["  ".join(f"{name} {text}" for name, text in fields.items() if text) or "nobody in particular is next"]


def start_list_lines(answer: dict[str, Any]) -> list[str]:
    """The start list, for people: the round, then one line for each jumper, the next one marked."""
    lines = [f"round {answer['round']}, {len(answer['lines'])} jumpers"]
    for line in answer["lines"]:
        mark = "next" if line["id"] == answer["next"]["line"] else line["mark"]
        fields = (line["athlete"], line["club"], f"gate {line['gate']}" if line["gate"] else "", *line["more"].values())
        lines.append(f"{mark:8} {line['bib']:>4}  {', '.join(text for text in fields if text)}")
    if answer["next"]["line"] is None:
        lines += ["next:", *jumper_lines(answer["next"])]
    return lines


def _said(statement: dict[str, Any]) -> str:
    return f"{statement['text']} -> {statement['advice']}" if statement["advice"] else str(statement["text"])
