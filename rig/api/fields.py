"""What fields of the REST API may hold: texts of one line, whole numbers, and the base of all models."""

from typing import Annotated, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


class Model(BaseModel):
    """Base of all models: unknown fields are errors, instances are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _no_other_type(value: object) -> object:
    if isinstance(value, bool | str):
        raise ValueError("Input should be a valid integer")  # noqa: TRY004 - pydantic makes an answer of a ValueError
    return value


#: Makes an integer what JSON schema understands by it: 3.0 is one, true and "3" are none. Stands behind limits.
WHOLE: Final = BeforeValidator(_no_other_type)
WholeNumber = Annotated[int, WHOLE]
LONGEST_LINE: Final = 200
Line = Annotated[str, Field(max_length=LONGEST_LINE, pattern=r"^[^\x00-\x1f\x7f]*$")]
Text = Annotated[str, Field(max_length=4000, pattern=r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$")]
LONGEST_TAG: Final = 40
Tag = Annotated[str, Field(min_length=1, max_length=LONGEST_TAG, pattern=r"^[^\x00-\x1f\x7f,]*$")]
