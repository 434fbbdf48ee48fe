"""When a recording goes on in its next part, written into the text of the rig file."""

import tomlkit

from rig.settings.editing import as_toml, editable

_TABLE = "recorder"


def written_parts(text: str, part_s: float | None, part_gb: float | None) -> str:
    """The text of a rig file with other limits for the parts of a recording; everything else in it stays as it is.

    Args:
        text: of the rig file (TOML).
        part_s: longest part, s; None: any.
        part_gb: largest part, 10^9 bytes; None: any.

    Raises:
        BadInputError: the text is not TOML.
    """
    document = editable(text)
    recorder = document.get(_TABLE, {})
    for name, limit in (("part_s", part_s), ("part_gb", part_gb)):
        if limit is None:
            recorder.pop(name, None)
        else:
            recorder[name] = as_toml(limit)
    if recorder and _TABLE not in document:
        document[_TABLE] = recorder
    return tomlkit.dumps(document)
