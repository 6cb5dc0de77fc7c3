#!/usr/bin/env python3
"""Compares the verdicts of two tables of reproduced figures, and exits with 1 where they differ.

    verdicts.py guide/recorded/figures.md RUN/figures.md

`krylux reproduce` writes the table. Bold numbers miss their bounds. Values may differ between machines; verdicts may not.
"""

import sys


def verdicts(path):
    """The verdict of each number: (figure, number) -> which of its columns are bold."""
    found, figure = {}, ""
    with open(path, encoding="utf-8") as table:
        for line in table:
            if line.startswith("## "):
                figure = line[3:].strip()
            cells = [cell.strip() for cell in line.split("|")[1:-1]]
            if figure and len(cells) == 5 and not cells[0].startswith("-") and cells[0] != "number":
                found[figure, cells[0]] = [cell.startswith("**") for cell in cells[3:]]
    return found


def main():
    recorded, made = verdicts(sys.argv[1]), verdicts(sys.argv[2])
    if not made:
        sys.exit(f"{sys.argv[2]} has no numbers")
    names = {True: "misses its bound", False: "meets its bound"}
    differ = 0
    for key in sorted(recorded.keys() | made.keys()):
        if recorded.get(key) == made.get(key):
            continue
        differ += 1
        for where, of in ((sys.argv[1], recorded), (sys.argv[2], made)):
            columns = of.get(key)
            told = "is not there" if columns is None else ", ".join(
                f"{rig}: {names[bold]}" for rig, bold in zip(("ideal", "virtual"), columns))
            print(f"{key[0]}: {key[1]}\n  {where}: {told}")
    if differ:
        sys.exit(f"{differ} verdicts differ. If the change is right, copy the new table over {sys.argv[1]}.")
    print(f"{len(made)} numbers have the verdicts of {sys.argv[1]}")


main()
