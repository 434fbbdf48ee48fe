"""Hands out a log as a file, whole or in parts."""

import re
from http import HTTPStatus
from pathlib import Path
from typing import Final

from fastapi.responses import FileResponse
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from webpanel.problems import problem

_RANGES: Final = re.compile(r"bytes\s*=\s*(\d{1,18}-\d{0,18}|-\d{1,18})(\s*,\s*(\d{1,18}-\d{0,18}|-\d{1,18}))*\s*")


class RecordingFile(FileResponse):
    """A file to download. What is no sensible range is no range (RFC 9110, 14.2); one beyond the end is a problem."""

    def __init__(self, recording_id: str, path: Path) -> None:
        super().__init__(
            path, media_type="application/octet-stream", filename=f"{recording_id}.mcap", stat_result=path.stat()
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        asked = Headers(scope=scope).get("range")
        if asked is not None:
            size = int(self.headers["content-length"])
            spans = _spans(asked, size)
            if any(first >= size for first, _ in spans):
                text = f"the file has {size} bytes: ask for a range within it"
                headers = {"Content-Range": f"bytes */{size}"}
                status = HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE
                await problem(status, "range_not_satisfiable", text, headers)(scope, receive, send)
                return
            if not spans or any(first > last for first, last in spans):
                scope = {**scope, "headers": [pair for pair in scope["headers"] if pair[0] != b"range"]}
        await super().__call__(scope, receive, send)


def _spans(text: str, size: int) -> list[tuple[int, int]]:
    """First and last byte of each range; none if the header is not understood."""
    if not _RANGES.fullmatch(text):
        return []
    spans = []
    for part in text.partition("=")[2].split(","):
        first, _, last = part.strip().partition("-")
        if first:
            spans.append((int(first), int(last) if last else size - 1))
        else:
            spans.append((max(size - int(last), 0) if int(last) else size, size - 1))
    return spans
