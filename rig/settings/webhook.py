"""The settings of notifications for people who are elsewhere, and what an address of theirs must be."""

from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit

from pydantic import Field, model_validator

from rig.settings.strict_toml import StrictModel

#: What people who are elsewhere can be told.
Occasion = Literal["fault", "recording", "disk", "cameras", "alarms"]


def checked_url(url: str) -> str:
    """The address of a webhook, as it is.

    Raises:
        ValueError: it is none; the message does not quote it, since it may be secret.
    """
    try:
        place = urlsplit(url)
        known = place.scheme in {"http", "https"} and bool(place.hostname) and place.port != 0
    except ValueError:  # a port that is no number
        known = False
    if not known or not url.isascii() or not url.isprintable() or " " in url:
        raise ValueError("this is no address of a webhook: give one like https://example.org/hook")
    if place.username is not None:
        raise ValueError("the address holds a name or password: put the secret into token_file")
    return url


class WebhookSettings(StrictModel):
    """Where the service sends notifications, for people who are elsewhere."""

    url: str | None = Field(
        None, description="address that takes a POST of JSON; the rig file stands in every log, so it is no secret"
    )
    url_file: Path | None = Field(
        None, description="file that holds the address alone, where it is secret, relative to the rig file"
    )
    token_file: Path | None = Field(
        None, description="file with a token that is sent as Authorization: Bearer, relative to the rig file"
    )
    events: tuple[Occasion, ...] = Field(
        ("fault", "recording", "disk", "cameras", "alarms"),
        min_length=1,
        description="fault: the rig has one, and it is over; recording: one has ended, with its verdict; disk: nearly "
        "full; cameras: one is gone, and is back; alarms: pulses stop, their rate or spread changes, or a camera "
        "misses pulses, and it is over",
    )

    @model_validator(mode="after")
    def _one_address(self) -> "WebhookSettings":
        if (self.url is None) == (self.url_file is None):
            raise ValueError("a webhook needs its address: give url, or url_file where it is secret")
        if self.url is not None:
            checked_url(self.url)
        return self
