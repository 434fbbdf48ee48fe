"""The languages that pages and pictures for people speak."""

from enum import StrEnum


class Language(StrEnum):
    """One of them."""

    EN = "en"
    NB = "nb"
