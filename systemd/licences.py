"""Collects the licences of all wheels of a bundle, and says under which terms the whole stands: licences.py BUNDLE.

A wheel may hold libraries of others (`*.libs/`). Some of them are under the GPL (x264, x265), and so is then the whole
that is passed on. Of libraries that the wheel's own texts do not name, licence, copyright and texts are added by the
table `licence-texts/libraries.toml`. A wheel without the text of its licence gets the common one, with its author.
"""

import re
import sys
import tomllib
import zipfile
from email.message import Message
from email.parser import HeaderParser
from pathlib import Path

#: Libraries under the GPL, version 2 or later, that wheels are known to hold.
COPYLEFT = ("libx264", "libx265", "libxvidcore", "libpostproc")
_TEXTS = re.compile(r"[^/]+\.dist-info/(licenses/.+|(LICEN[CS]E|COPYING|NOTICE|AUTHORS)[^/]*)", re.IGNORECASE)
_LIBRARY = re.compile(r"(?:^|/)(lib[A-Za-z0-9_+]+)[^/]*\.so[^/]*$")
#: The tag by which a source file names its licence.
_TAG = re.compile(rb"SPDX-License-Identifier: *([A-Za-z0-9.-]+)")
#: Classifiers that name one licence alone.
_CLASSIFIED = {"MIT License": "MIT", "MIT": "MIT"}
COMMON = Path(__file__).parent / "licence-texts"
#: Where Debian keeps texts.
DEBIAN = Path("/usr/share/common-licenses")
_LIBRARIES = tomllib.loads((COMMON / "libraries.toml").read_text(encoding="utf-8"))

_TERMS = """This archive as a whole may be passed on under the GNU General Public License, version 3 or later
(licences/GPL-3), because it holds libraries under the GPL: {}.
Their sources: https://www.videolan.org/developers/x264.html, https://www.videolan.org/developers/x265.html,
https://ffmpeg.org; how they and the other libraries beside them were built, and from what:
https://github.com/PyAV-Org/pyav-ffmpeg.
Whoever passes the archive on offers these sources too.
Svev itself stays under its BSD licence, and each package under its own."""


def main(bundle: Path) -> None:
    """Write LICENCES.txt and the folder `licences` of a bundle."""
    rows, copyleft = [], []
    folder = bundle / "licences"
    for path in sorted((bundle / "wheels").glob("*.whl")):
        with zipfile.ZipFile(path) as wheel:
            name, row = _row(wheel, folder)
            inside = sorted(
                {found[1] for each in wheel.namelist() if ".libs/" in each and (found := _LIBRARY.search(each))}
            )
        _add_libraries(name, inside, folder)
        rows.append(row + (f"\n    libraries of others inside: {', '.join(inside)}" if inside else ""))
        copyleft += [f"{library} in {name}" for library in inside if library.startswith(COPYLEFT)]
    if copyleft:
        _add_text("GPL-3", folder)
        terms = _TERMS.format(", ".join(copyleft))
    else:
        terms = "No library under the GPL was found in it: each package stands under its own licence, Svev under BSD."
    text = f"{terms}\n\nPackages, with their licences as they state them; the texts are in licences/.\n\n"
    (bundle / "LICENCES.txt").write_text(text + "\n".join(rows) + "\n", encoding="utf-8")


def _row(wheel: zipfile.ZipFile, folder: Path) -> tuple[str, str]:
    """Name and line of a wheel; its licence texts go into a folder of its own."""
    (about,) = (each for each in wheel.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", each))
    fields = HeaderParser().parsestr(wheel.read(about).decode("utf-8"))
    name = f"{fields['Name']} {fields['Version']}"
    place = folder / name.replace(" ", "-")
    place.mkdir(parents=True)
    texts = [each for each in wheel.namelist() if _TEXTS.fullmatch(each) and not each.endswith("/")]
    for each in texts:
        (place / each.partition("/")[2].replace("/", "-")).write_bytes(wheel.read(each))
    if not texts:
        (place / "LICENCE").write_text(_common(wheel, fields, name), encoding="utf-8")
    return name, f"{name}: {_stated(fields)}" + ("" if texts else " (the wheel holds no text; the common one is added)")


def _add_libraries(wheel: str, libraries: list[str], folder: Path) -> None:
    """Add licence, copyright and texts of the libraries in a wheel that its own texts do not name."""
    place = folder / wheel.replace(" ", "-")
    own = "".join(
        f"{each.name}\n{each.read_text(encoding='utf-8', errors='replace')}" for each in place.iterdir()
    ).lower()
    lines, texts = [], set[str]()
    for library in libraries:
        beginning = max((each for each in _LIBRARIES if library.startswith(each)), key=len, default=library)
        known = _LIBRARIES.get(beginning, {})
        word = known.get("word", beginning.removeprefix("lib")).lower()
        if re.search(rf"(?<![a-z])(lib)?{word}(?![a-z])", own):
            continue
        if "licence" not in known:
            sys.exit(f"{wheel} holds {library}, which its texts do not name: add it to {COMMON / 'libraries.toml'}")
        lines.append(f"{library}: {known['licence']}, copyright (c) {known['copyright']}\n")
        texts.update(known["texts"])
    for text in sorted(texts):
        _add_text(text, folder)
    if lines:
        head = f"Libraries of others inside {wheel}; the texts of their licences are in the folder above.\n\n"
        (place / "LIBRARIES").write_text(head + "".join(lines), encoding="utf-8")


def _add_text(name: str, folder: Path) -> None:
    """Add the common text of a licence, ours or Debian's."""
    ours = COMMON / name
    (folder / name).write_bytes((ours if ours.is_file() else DEBIAN / name).read_bytes())


def _common(wheel: zipfile.ZipFile, fields: Message, name: str) -> str:
    """The text of the licence of a wheel that holds none."""
    stated = fields["License-Expression"] or _CLASSIFIED.get(_stated(fields))
    if stated is None:  # "BSD License" are several
        sources = [each for each in wheel.namelist() if each.endswith(".py")]
        tags = {tag.decode() for each in sources for tag in _TAG.findall(wheel.read(each))}
        stated = tags.pop() if len(tags) == 1 else ""
    text = COMMON / stated
    if not text.is_file():
        sys.exit(f"{name} holds no text of its licence ({_stated(fields)}): add the common one to {COMMON}")
    author = fields["Author"] or fields["Author-email"] or f"the authors of {fields['Name']}"
    page = fields["Home-page"] or ", ".join(fields.get_all("Project-URL", []))
    said = f"{name} ({page}) holds no text of its licence, and names it {stated}."
    return f"{said}\n\nCopyright (c) {author}\n\n{text.read_text(encoding='utf-8')}"


def _stated(fields: Message) -> str:
    """The licence that a package states: as an expression, by classifiers, or in words."""
    if expression := fields["License-Expression"]:
        return str(expression)
    trove = [each.rpartition(" :: ")[2] for each in fields.get_all("Classifier", []) if each.startswith("License ::")]
    words = (fields["License"] or "not stated").strip().splitlines()
    return ", ".join(trove) or words[0]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
