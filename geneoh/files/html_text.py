"""Text of HTML pages."""

import html
from urllib.parse import quote


def link(file: str, words: str) -> str:
    """A link to a file beside the page; its name may hold any letter."""
    return f'<a href="{quote(file)}">{html.escape(words)}</a>'
