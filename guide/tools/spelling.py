"""Holds the words of the README and the guide against aspell's British dictionary (with -ize) and `words.txt`.

    python3 guide/tools/spelling.py            (Debian: apt install aspell aspell-en)

A word that is not known is named with its page. A name or a term of the field goes into `words.txt`, in alphabetical order.
"""

import re
import subprocess
import sys
from pathlib import Path

from plain import prose

ROOT = Path(__file__).resolve().parents[2]
OWN = ROOT / "guide/tools/words.txt"


def unknown(words: set[str]) -> set[str]:
    """Those of the words that aspell does not know."""
    aspell = ["aspell", "list", "--master=en_GB-ize", "--encoding=utf-8"]
    found = subprocess.run(aspell, input="\n".join(sorted(words)), capture_output=True, text=True, check=True)
    return set(found.stdout.split())


def words_of(path: Path) -> set[str]:
    """The words of a page; numbers and single letters are none."""
    words = re.findall(r"[^\W\d_]{2,}(?:['’][^\W\d_]+)?", prose(path.read_text()))
    return {re.sub(r"['’]s$", "", word) for word in words}


def main() -> int:
    own = OWN.read_text().split()
    if own != sorted(set(own), key=str.lower):
        print("guide/tools/words.txt is not in alphabetical order, or has a word twice", file=sys.stderr)
        return 1
    # The reference of the command line is what the program itself says.
    pages = [ROOT / "README.md", *sorted((ROOT / "guide/src").rglob("*.md"))]
    spelled = {page: words_of(page) for page in pages}
    known = {word.lower() for word in own}
    wrong = {word for word in unknown(set().union(*spelled.values())) if word.lower() not in known}
    for page in pages:
        for word in sorted(spelled[page] & wrong):
            print(f"{page.relative_to(ROOT)}: {word}", file=sys.stderr)
    used = set().union(*spelled.values())
    lower = {word.lower() for word in used}
    for word in own:
        if word.lower() not in lower:
            print(f"guide/tools/words.txt: no page has {word}", file=sys.stderr)
            wrong.add(word)
    print(f"{len(pages)} pages, {len(used)} different words, {len(wrong)} of them unknown")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
