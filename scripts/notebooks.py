"""Runs the examples and makes notebooks of them, for the book.

python scripts/notebooks.py [FOLDER]    runs all, writes their figures into docs/gallery and the page docs/gallery.md,
                                        and the notebooks into FOLDER, by default target/book/notebooks

An example is a notebook as text: its cells begin with `# %%`, as editors and jupytext read them.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GALLERY = ROOT / "docs" / "gallery"
NAMES = ("first_lock", "figures", "controller", "recording", "sweep", "tuning")


def cells(name: str) -> list[tuple[str, str]]:
    """Kind (markdown or code) and text of the cells of an example."""
    found = []
    for part in f"\n{(ROOT / 'examples' / f'{name}.py').read_text()}".split("\n# %%")[1:]:
        kind, _, text = part.partition("\n")
        if kind.strip() == "[markdown]":
            found.append(("markdown", "\n".join(line.removeprefix("#")[1:] for line in text.strip().splitlines())))
        else:
            found.append(("code", text.strip()))
    return found


def notebook(name: str) -> str:
    """The notebook in Jupyter's format."""
    made = []
    for number, (kind, text) in enumerate(cells(name)):
        cell = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": text.splitlines(keepends=True)}
        made.append(cell | ({"execution_count": None, "outputs": []} if kind == "code" else {}))
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return json.dumps({"cells": made, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}, indent=1)


def page() -> str:
    """The gallery: what each example is about, its figure, and the cell that draws it."""
    text = "# Gallery\n\n<!-- Written by scripts/notebooks.py; change the examples, not this page. -->\n\n"
    text += "Each figure is that of a notebook, which runs where the [Python package](python.md) is installed with\n"
    text += "`[all]`. Jupyter opens it. Every build of the book runs it. Below the figure are the lines that draw it.\n"
    for name in NAMES:
        parts = cells(name)
        title, _, about = parts[0][1].partition("\n")
        text += f"\n#{title}\n\n{about.strip()} [Notebook](notebooks/{name}.ipynb), [as text](../examples/{name}.py).\n"
        text += f"\n![{title.lstrip('# ')}](gallery/{name}.svg)\n\n```python,norun\n{parts[-1][1]}\n```\n"
    return text


def main(folder: Path) -> None:
    """Run the examples in folders of their own; a failure ends the script."""
    GALLERY.mkdir(exist_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    for name in NAMES:
        with tempfile.TemporaryDirectory() as work:
            environment = os.environ | {"MPLBACKEND": "agg"}
            command = [sys.executable, ROOT / "examples" / f"{name}.py"]
            subprocess.run(command, check=True, cwd=work, env=environment, stdout=subprocess.DEVNULL)
            (GALLERY / f"{name}.svg").write_bytes((Path(work) / f"{name}.svg").read_bytes())
        (folder / f"{name}.ipynb").write_text(notebook(name))
    (ROOT / "docs" / "gallery.md").write_text(page())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "target" / "book" / "notebooks")
