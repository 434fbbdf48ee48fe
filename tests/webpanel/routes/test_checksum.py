"""The checksum of a file so large that nobody waits for its end."""

import io
import threading

import httpx
import pytest

from service.seam.archive import Download
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import serving
from webpanel.door.access import Access

SUM = "/api/recordings/jump/file.sha256"


class _Endless(io.RawIOBase):
    """A file that has no end."""

    reads = 0

    def read(self, size: int = -1) -> bytes:
        """Zeros."""
        type(self).reads += 1
        return bytes(size)


@pytest.fixture
def endless(service: MemoryService, monkeypatch: pytest.MonkeyPatch) -> list[_Endless]:
    """The files that were opened for the recording `jump`."""
    opened: list[_Endless] = []

    def open_one() -> _Endless:
        opened.append(_Endless())
        return opened[-1]

    download = Download("jump.mcap", 1 << 50, 0.0, "tag", corrected=False, open=open_one)  # type: ignore[arg-type]
    monkeypatch.setattr(service, "download", lambda _: download)
    return opened


def test_a_checksum_ends_when_its_client_has_left(service: MemoryService, endless: list[_Endless]) -> None:
    with serving(service, Access("127.0.0.1")) as panel, panel.client() as client:
        with pytest.raises(httpx.ReadTimeout):
            client.get(SUM, timeout=0.3)
        wait_until(lambda: bool(endless) and endless[0].closed, "the file is closed")


def test_a_checksum_does_not_keep_the_service_from_ending(service: MemoryService, endless: list[_Endless]) -> None:
    asked: threading.Thread
    with serving(service, Access("127.0.0.1")) as panel:

        def ask() -> None:
            with panel.client() as client:
                assert client.get(SUM).status_code == 409

        asked = threading.Thread(target=ask)
        asked.start()
        wait_until(lambda: bool(endless) and endless[0].reads > 0, "the file is read")
    asked.join(20)
    assert not asked.is_alive()
    assert endless[0].closed
