"""How hard pages are to read: words, words a sentence, and the Flesch-Kincaid grade (school years that a reader needs).

    python3 guide/tools/reading_level.py PAGE...      (README.md - reads standard input)

Tables and code are left out. Syllables are counted as groups of vowels, which is right on average: figures are for comparing pages.
"""

import re
import sys
from pathlib import Path

from plain import prose


def syllables(word: str) -> int:
    word = re.sub(r"(?:[^laeiouy]es|ed|[^laeiouy]e)$", "", word.lower())
    return max(1, len(re.findall(r"[aeiouy]+", word)))


def level(text: str) -> tuple[int, float, float, float]:
    """Words, words a sentence, the share of long sentences (more than 25 words), and the grade."""
    paragraphs = re.split(r"\n\s*\n|\n\s*(?:[*-]|\d+\.)\s", prose(text, tables=False))
    sentences = [part for paragraph in paragraphs for part in re.split(r"(?<=[.!?:;])\s+", paragraph.strip())]
    counted = [re.findall(r"[^\W\d_]+", sentence) for sentence in sentences]
    counted = [words for words in counted if len(words) > 2]
    words = [word for sentence in counted for word in sentence]
    mean = len(words) / len(counted)
    long = sum(len(sentence) > 25 for sentence in counted) / len(counted)
    grade = 0.39 * mean + 11.8 * sum(map(syllables, words)) / len(words) - 15.59
    return len(words), mean, long, grade


def main() -> None:
    print("  words  words a sentence  sentences over 25 words  grade  page")
    for name in sys.argv[1:]:
        text = sys.stdin.read() if name == "-" else Path(name).read_text()
        words, mean, long, grade = level(text)
        print(f"{words:7}  {mean:16.1f}  {100 * long:21.0f} %  {grade:5.1f}  {name}")


if __name__ == "__main__":
    main()
