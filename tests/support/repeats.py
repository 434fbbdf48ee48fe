"""Tests that tell one story several times, with other cameras, sizes or seeds: which of them `make test` tells."""

from collections.abc import Iterable
from typing import Any

import pytest


def repeats(values: Iterable[Any], *, quick: int = 1) -> list[Any]:
    """Values for `pytest.mark.parametrize`: after the first `quick` of them, the tests are `long`.

    A tuple or list holds the values of several arguments, in their order.
    """
    found = []
    for place, value in enumerate(values):
        arguments = value if isinstance(value, tuple | list) else [value]
        found.append(pytest.param(*arguments, marks=[pytest.mark.long] if place >= quick else []))
    return found
