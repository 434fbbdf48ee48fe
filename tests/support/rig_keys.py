"""The table of all keys in `docs/reference/rig-file.md`, made from the JSON schema of the rig file.

`python -m tests.support.rig_keys` writes it anew; a test compares it with the page.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from rig.settings.file import rig_schema

PAGE: Final = Path(__file__).resolve().parents[2] / "docs" / "reference" / "rig-file.md"
_BEGIN: Final = "<!-- all keys: written by python -m tests.support.rig_keys, do not edit -->"
_END: Final = "<!-- end of all keys -->"
_HEAD: Final = "| key | unit | if left out | values | is |\n|---|---|---|---|---|\n"
#: Units by the ending of a key, and of keys without one.
_ENDINGS: Final = {
    "_hz": "Hz",
    "_s": "s",
    "_ms": "ms",
    "_us": "µs",
    "_mb": "MB",
    "_gb": "GB",
    "_db": "dB",
    "_GB": "GB",
    "_days": "days",
    "_hours": "h",
    "_speed": "Mbit/s",
}
_PLAIN: Final = {"x": "px", "y": "px", "width": "px", "height": "px", "packet_size": "bytes", "dma_frames": "frames"}
#: Tables of the rig file: heading, where its model stands in the schema.
_TABLES: Final = (
    ("At the top", None),
    ("`[[cameras]]`, one for each", "CameraSettings"),
    ("`region`, `calibrated_region` of a camera, `region` of `[automatic.motion]`", "Region"),
    ("`iidc` of a FireWire camera", "IidcSettings"),
    ("`[trigger]`, every source", "ExternalTrigger"),
    ('`[trigger]`, `source = "triggerbox"`', "TriggerBoxTrigger"),
    ('`[trigger]`, `source = "action"`', "ActionTrigger"),
    ('`[trigger]`, `source = "gpio"`', "GpioTrigger"),
    ("`gate` of a GPIO trigger", "GateSettings"),
    ("`[recorder]`", "RecorderSettings"),
    ("`[network]`", "NetworkSettings"),
    ("`[service]`", "ServiceSettings"),
    ("`[service.webhook]`", "WebhookSettings"),
    ("`[analysis]`", "AnalysisSettings"),
    ("`[offload]`", "OffloadSettings"),
    ("`[automatic]`", "AutomaticSettings"),
    ("`[automatic.motion]`", "MotionSettings"),
    ("`[automatic.barrier]`", "BarrierSettings"),
    ("`[simulation]`", "SimulationSettings"),
)
#: Sources that have the keys of every source alone.
_BARE: Final = ("SoftwareTrigger", "IidcBroadcastTrigger")


def key_tables() -> str:
    """A heading and a table, in Markdown, for each table of the rig file.

    Raises:
        ValueError: the schema has a model that stands in no table here, or a key without a description.
    """
    schema = json.loads(rig_schema())
    models: dict[str | None, Any] = {**schema["$defs"], None: schema}
    if missing := set(schema["$defs"]) - {model for _, model in _TABLES} - set(_BARE):
        raise ValueError(f"in no table of the page: {', '.join(sorted(missing))}")
    common = set(models["ExternalTrigger"]["properties"])
    parts = []
    for heading, name in _TABLES:
        model = models[name]
        further = name is not None and name.endswith("Trigger") and name != "ExternalTrigger"
        keys = {key: about for key, about in model["properties"].items() if not (further and key in common)}
        rows = "".join(_row(key, about, key in model.get("required", ()), schema) for key, about in keys.items())
        parts.append(f"### {heading}\n\n{_HEAD}{rows}")
    return "\n".join(parts)


def _row(key: str, about: dict[str, Any], needed: bool, schema: dict[str, Any]) -> str:
    if "description" not in about:
        raise ValueError(f"{key} has no description")
    if key == "source":
        words = "; ".join(_sources(schema))
        return f'| `source` | | `"external"` | | {words} |\n'
    default = "**needed**" if needed else _default(about)
    words = about["description"].replace("|", "\\|")
    return f"| `{key}` | {_unit(key)} | {default} | {', '.join(_values(about))} | {words} |\n"


def _sources(schema: dict[str, Any]) -> Iterator[str]:
    """Each source of pulses in words."""
    for value, where in schema["properties"]["trigger"]["discriminator"]["mapping"].items():
        model = schema["$defs"][where.rsplit("/", 1)[1]]
        yield f'`"{value}"`: {model["properties"]["source"]["description"]}'


def _unit(key: str) -> str:
    return _PLAIN.get(key) or next((unit for ending, unit in _ENDINGS.items() if key.endswith(ending)), "")


def _default(about: dict[str, Any]) -> str:
    """What holds if the key is left out; a table of its own has its defaults there."""
    value = about.get("default")
    if value in (None, "") or isinstance(value, dict):
        return "none" if value in (None, "") else "as in its table"
    return f"`{json.dumps(value)}`"


def _values(about: dict[str, Any]) -> Iterator[str]:
    """What a value may be: a choice, or a range."""
    for each in about.get("anyOf", [about]):
        if "enum" in each or "enum" in each.get("items", {}):
            yield from (f"`{json.dumps(value)}`" for value in each.get("enum") or each["items"]["enum"])
        least, most = (
            next((f"{sign} {each[name]}" for name, sign in names if name in each), "")
            for names in (
                (("minimum", "≥"), ("exclusiveMinimum", ">")),
                (("maximum", "≤"), ("exclusiveMaximum", "<")),
            )
        )
        if least or most:
            yield " and ".join(filter(None, (least, most)))
        elif each.get("type") == "boolean":
            yield "`true`, `false`"


def written_in(page: str) -> str:
    """The text of the page with the tables as the schema gives them now."""
    before, _, rest = page.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return f"{before}{_BEGIN}\n\n{key_tables()}\n{_END}{after}"


if __name__ == "__main__":
    PAGE.write_text(written_in(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
