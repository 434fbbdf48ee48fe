"""Applying a function to many arguments, here or elsewhere."""

from collections.abc import Callable, Iterable
from typing import Any

#: `map`, or what does the same on other processors: results in the order of the arguments, which are taken one by one.
Each = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
