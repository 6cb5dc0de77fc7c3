#!/usr/bin/env python3
"""Compares the verdicts of two tables of reproduced figures, and exits with 1 where they differ.

    verdicts.py guide/recorded/figures.md RUN/figures.md

`krylux reproduce` writes the table. Bold numbers miss their bounds. Values may differ between machines; verdicts may not. A rig that
the second table does not have is left out.
"""

import sys


def verdicts(path):
    """Whether each number misses its bound: (figure, number, rig) -> bool."""
    found, figure = {}, ""
    with open(path, encoding="utf-8") as table:
        for line in table:
            if line.startswith("## "):
                figure = line[3:].strip()
            cells = [cell.strip() for cell in line.split("|")[1:-1]]
            if figure and len(cells) == 5 and cells[0] != "number" and not cells[0].startswith("-"):
                for rig, cell in zip(("ideal", "virtual"), cells[3:]):
                    if cell != "–":
                        found[figure, cells[0], rig] = cell.startswith("**")
    return found


def main():
    recorded, made = verdicts(sys.argv[1]), verdicts(sys.argv[2])
    rigs = {rig for _, _, rig in made}
    recorded = {key: misses for key, misses in recorded.items() if key[2] in rigs}
    if not made:
        sys.exit(f"{sys.argv[2]} has no numbers")
    told = {None: "is not there", True: "misses its bound", False: "meets its bound"}
    differ = [key for key in sorted(recorded.keys() | made.keys()) if recorded.get(key) != made.get(key)]
    for key in differ:
        print(f"{key[0]}, {key[2]}: {key[1]}")
        print(f"  {sys.argv[1]}: {told[recorded.get(key)]}; {sys.argv[2]}: {told[made.get(key)]}")
    if differ:
        sys.exit(f"{len(differ)} verdicts differ. If the change is right, copy the new table over {sys.argv[1]}.")
    print(f"{len(made)} numbers have the verdicts of {sys.argv[1]}")


main()
