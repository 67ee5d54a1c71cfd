"""A hook of MkDocs (mkdocs.yml): bars in code within tables are shown without the backslash that GitHub needs before them."""

import re
from typing import Any


def on_page_content(html: str, **_: Any) -> str:
    """The HTML of a page with `\\|` in code written as a bar."""
    return re.sub(r"<code>[^<]*</code>", lambda code: code[0].replace("\\|", "|"), html)
