"""Hook of MkDocs (mkdocs.yml) that removes the backslash before bars in code. GitHub needs it in tables."""

import re
from typing import Any


def on_page_content(html: str, **_: Any) -> str:
    """Return the HTML of a page with `\\|` in code replaced by a bar."""
    return re.sub(r"<code>[^<]*</code>", lambda code: code[0].replace("\\|", "|"), html)
