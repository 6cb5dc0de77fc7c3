"""Markdown without what is not prose: code, links' targets, formulas, HTML and tables' rules."""

import re


def prose(text: str, tables: bool = True) -> str:
    """The words of a page that a reader reads."""
    text = re.sub(r"<!--.*?-->", " ", text, flags=re.S)
    text = re.sub(r"^( *)```.*?^\1```", " ", text, flags=re.S | re.M)
    text = re.sub(r"`[^`]*`", " ", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"https?://\S+|doi:\S+|<[^>]+>|\{\{[^}]*\}\}", " ", text)
    if not tables:
        text = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("|"))
    return re.sub(r"[|*_#]+", " ", text)
