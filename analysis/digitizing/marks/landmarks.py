"""Reads a person's own landmarks from a TOML file: templates, each a list that is gone through in its order."""

from pathlib import Path
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from photogrammetry.jumper.centre_of_mass import LANDMARKS
from rig.settings.strict_toml import StrictModel, read_toml, validate

#: The file beside the recordings.
NAME: Final = "landmarks.toml"
#: Groups of things that every log has.
_GROUPS: Final = ("jumper", "body", "balls")

Words = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\W_][^\\/:;]*$")]


class Landmark(StrictModel):
    """A point of the jumper, his suit or his skis.

    Attributes:
        name: by which its marks are kept.
        colour: in which it is drawn; None: that of all landmarks.
    """

    name: Words
    colour: Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")] | None = None


class Template(StrictModel):
    """Landmarks that are measured together, in this order."""

    name: Words
    landmark: Annotated[tuple[Landmark, ...], Field(min_length=1, max_length=200)]


class LandmarksFile(StrictModel):
    """All templates of a file."""

    template: Annotated[tuple[Template, ...], Field(min_length=1, max_length=50)]

    @model_validator(mode="after")
    def _differ(self) -> Self:
        for kind, names in (
            ("landmark", [*LANDMARKS, *(point.name for of in self.template for point in of.landmark)]),
            ("template", [*_GROUPS, *(of.name for of in self.template)]),
        ):
            if twice := next((name for i, name in enumerate(names) if name in names[:i]), None):
                raise ValueError(f'there is a {kind} "{twice}" already; give this one another name')
        return self


def read_landmarks(path: Path) -> tuple[Template, ...]:
    """The templates of a file.

    Raises:
        BadInputError: it is missing or wrong; the message names key and remedy.
    """
    return validate(LandmarksFile, read_toml(path, kind="file of landmarks"), path).template
