"""Numbers and tables as text and Markdown, and files that are replaced whole."""

import textwrap

# Where there is nothing to be said.
NONE = "\N{EN DASH}"


def number(x, digits=3):
    return NONE if x is None else f"{x:.{digits}g}"


def ratio(x):
    """A ratio to two digits."""
    if x is None:
        return NONE
    if x < 100:
        return f"{x:.2g}"
    return f"{float(f'{x:.2g}'):.0f}" if x < 10000 else f"{x:.0e}".replace("e+0", "e")


def compared(row, plant):
    """Time of a row over the plant's, and the quartiles of that ratio."""
    if plant is None:
        return NONE, NONE
    low, middle, high = row.over(plant)
    return number(middle), NONE if low is None else f"{number(low)} to {number(high)}"


def text_table(head, rows):
    widths = [max(len(row[n]) for row in [head, *rows]) for n in range(len(head))]
    lines = []
    for row in [head, *rows]:
        lines.append(
            "  ".join(
                cell.ljust(w) if n in (0, len(row) - 1) else cell.rjust(w)
                for n, (cell, w) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
        )
    return "\n".join(lines)


def markdown_table(head, rows):
    align = ["---"] + ["---:"] * (len(head) - 2) + ["---"]
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, align, *rows])


def wrapped(text):
    """Markdown with prose in lines of at most 140 characters."""
    kept = ("|", "!", "#")
    fill = textwrap.TextWrapper(140, break_long_words=False, break_on_hyphens=False).fill
    return "\n".join(fill(line) if len(line) > 140 and not line.startswith(kept) else line for line in text.split("\n"))


def replace(file, text):
    """Writes a file as a whole or not at all."""
    part = file.with_suffix(".part")
    part.write_text(text)
    part.replace(file)
