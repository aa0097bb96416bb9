"""Executes the examples as notebooks, for the book.

python scripts/notebooks.py [FOLDER]    writes the notebooks with outputs into FOLDER, by default target/book/notebooks;
                                        their figures into docs/gallery, and the page docs/gallery.md

An example is a notebook as text: its cells begin with `# %%`, as editors and jupytext read them.
"""

import sys
import tempfile
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parent.parent
GALLERY = ROOT / "docs" / "gallery"
# Without the warning that messages on loopback are not encrypted.
QUIET = ["--log-level=ERROR"]
NAMES = ("first_lock", "figures", "controller", "recording", "sweep", "tuning")


def notebook(name: str) -> nbformat.NotebookNode:
    """The notebook of an example, not yet executed."""
    made = jupytext.read(ROOT / "examples" / f"{name}.py", fmt="py:percent")
    made.metadata = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return made


def page() -> str:
    """The gallery: what each example is about, its figure, and the cell that draws it."""
    text = "# Gallery\n\n<!-- Written by scripts/notebooks.py; change the examples, not this page. -->\n\n"
    text += "Each figure is that of a notebook, which runs where the [Python package](python.md) is installed with\n"
    text += "`[all]`. Jupyter opens it. Every build of the book runs it. Below the figure are the lines that draw it.\n"
    for name in NAMES:
        cells = notebook(name).cells
        title, _, about = cells[0].source.partition("\n")
        text += f"\n#{title}\n\n{about.strip()} [Notebook](notebooks/{name}.ipynb), [as text](../examples/{name}.py).\n"
        text += f"\n![{title.lstrip('# ')}](gallery/{name}.svg)\n\n```python,norun\n{cells[-1].source}\n```\n"
    return text


def main(folder: Path) -> None:
    """Execute the notebooks in folders of their own; a failure ends the script."""
    GALLERY.mkdir(exist_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    for name in NAMES:
        executed = notebook(name)
        with tempfile.TemporaryDirectory() as work:
            NotebookClient(
                executed, timeout=600, resources={"metadata": {"path": work}}, extra_arguments=QUIET
            ).execute()
            (GALLERY / f"{name}.svg").write_bytes((Path(work) / f"{name}.svg").read_bytes())
        nbformat.write(executed, folder / f"{name}.ipynb")
    (ROOT / "docs" / "gallery.md").write_text(page())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "target" / "book" / "notebooks")
