"""Runs the notebooks, which are kept as scripts, and renders each into a page of `docs/notebooks`.

`python python/notebooks/render.py [--check] [NAME ...]`

A notebook is a script of cells: `# %%` begins code, `# %% [markdown]` begins text. The page holds the text, the code,
what it printed, and its figures. With `--check` the notebooks run, and nothing is written. The paths in them are
relative to the repository's root.
"""

import contextlib
import html
import io
import os
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
PAGES = ROOT / "docs" / "notebooks"
NAMES = ["first_groups", "krylov_in_your_own_code", "compensation_on_a_virtual_rig", "data_set_for_learned_models"]


def cells(script):
    """``(is text, lines)`` of each cell."""
    found = []
    for line in script.splitlines():
        if line.startswith("# %%"):
            found.append((line.strip() == "# %% [markdown]", []))
        elif found:
            found[-1][1].append(line)
    return [(is_text, "\n".join(lines).strip()) for is_text, lines in found]


def run_cell(code, scope):
    """Runs a cell, and returns what it printed and the value of its last line, as HTML."""
    import ast

    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, shown = io.StringIO(), ""
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<notebook>", "exec"), scope)  # noqa: S102 - the notebooks are this repository's own
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "<notebook>", "eval"), scope)
            if hasattr(value, "_repr_html_"):
                shown = value._repr_html_()
    text = f"<pre class='out'>{html.escape(printed.getvalue())}</pre>" if printed.getvalue() else ""
    return text + shown + figures()


def figures():
    """The open figures of Matplotlib as HTML, which are closed."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is None:
        return ""
    # The names of a figure's parts are the same in each run.
    pyplot.rcParams["svg.hashsalt"] = "krylux"
    found = []
    for number in pyplot.get_fignums():
        text = io.StringIO()
        pyplot.figure(number).savefig(text, format="svg", metadata={"Date": None})
        found.append(text.getvalue()[text.getvalue().index("<svg"):])
        pyplot.close(number)
    return "".join(found)


def text_of(lines):
    """The HTML of a text cell: headings, paragraphs and code in backticks."""
    body = "\n".join(line.removeprefix("#").strip() for line in lines.splitlines())
    parts = []
    for block in body.split("\n\n"):
        marked = html.escape(block)
        pieces = marked.split("`")
        marked = "".join(f"<code>{piece}</code>" if at % 2 else piece for at, piece in enumerate(pieces))
        parts.append(f"<h1>{marked[2:]}</h1>" if block.startswith("# ") else f"<p>{marked}</p>")
    return "".join(parts)


PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 16px/1.5 sans-serif; max-width: 52em; margin: 2em auto; padding: 0 1em }}
pre {{ background: #f4f4f4; padding: .7em; overflow: auto }} pre.out {{ background: none; border-left: 3px solid #4477aa }}
</style>{body}</html>
"""


def render(name, writes):
    """Runs one notebook, and writes its page."""
    start, scope, body = time.perf_counter(), {"__name__": "notebook"}, []
    for is_text, content in cells((FOLDER / f"{name}.py").read_text()):
        if is_text:
            body.append(text_of(content))
        else:
            body.append(f"<pre>{html.escape(content)}</pre>" + run_cell(content, scope))
    if writes:
        PAGES.mkdir(parents=True, exist_ok=True)
        (PAGES / f"{name}.html").write_text(PAGE.format(title=name.replace("_", " "), body="".join(body)))
    print(f"{name}: {time.perf_counter() - start:.1f} s")


def main():
    os.chdir(ROOT)
    os.environ.setdefault("MPLBACKEND", "svg")
    names = [name for name in sys.argv[1:] if not name.startswith("--")] or NAMES
    for name in names:
        render(name, writes="--check" not in sys.argv)


if __name__ == "__main__":
    main()
