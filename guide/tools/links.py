"""Follows every link and picture of the built guide within it, anchors included.

    mdbook build guide -d FOLDER && python3 guide/tools/links.py FOLDER
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The links of a page, and the anchors that links may lead to."""

    def __init__(self, path: Path):
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        of = {name: value or "" for name, value in attributes}
        self.anchors.update(of[name] for name in ("id", "name") if name in of)
        self.links.update(of[name] for name in ("href", "src") if name in of)


def main() -> int:
    folder = Path(sys.argv[1]).resolve()
    # The page for printing holds all others, whose links it repeats.
    paths = [path for path in folder.rglob("*.html") if path.name not in ("print.html", "toc.html", "404.html")]
    pages = {path: Page(path) for path in paths}
    followed, dead = 0, []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            followed += 1
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                dead.append(f"{path.relative_to(folder)}: {link} leads nowhere")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                dead.append(f"{path.relative_to(folder)}: {link} has no such anchor")
    print("\n".join(dead))
    print(f"{len(pages)} pages, {followed} links, {len(dead)} of them dead")
    return 1 if dead or not followed else 0


if __name__ == "__main__":
    sys.exit(main())
