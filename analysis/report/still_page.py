"""The frame of a page that is one file: it runs no script and loads nothing."""

import base64
import hashlib
from html import escape


def still_page(title: str, body: str, style: str, *, language: str = "en", images: bool = False) -> str:
    """The whole page as HTML.

    Args:
        title: plain text.
        body: HTML.
        style: CSS.
        language: of the words, as HTML names it.
        images: whether the body holds pictures, as data.
    """
    sha = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    shown = " img-src data:;" if images else ""
    policy = f"default-src 'none';{shown} style-src 'sha256-{sha}'; base-uri 'none'; form-action 'none'"
    head = (
        f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style>"
    )
    return f'<!doctype html>\n<html lang="{language}"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'
