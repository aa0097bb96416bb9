"""The command line of the package.

`python -m vines fit FILE ...` is `vines fit` with all its options, for all formats of recordings and dialects of
tables; `python -m vines fit --help` lists them. `python -m vines structure` makes a scene of a modal test in a
universal file.
"""

import argparse
import io
import os
import signal
import sys
import warnings
from pathlib import Path
from typing import TextIO

from . import __version__, _native, scene_from_uff
from .recordings import contents_of


def main(words: list[str] | None = None) -> int:
    """Run a command, print its results, and return the exit code."""
    given = sys.argv[1:] if words is None else words
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A result is never lost by the encoding of a terminal or a file.
            stream.reconfigure(errors="replace")
    if given[:1] == ["fit"]:
        code, out, err = _native.command_line(given, contents_of)
        return max(code, _printed(out, sys.stdout), _printed(err, sys.stderr))
    parser = argparse.ArgumentParser(
        prog="python -m vines", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=f"vines {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commands.add_parser("fit", help="fit the parameters of a rig to recordings or points, as `vines fit` does")
    structure = commands.add_parser("structure", help="make a scene of the modes in a universal file (UFF 55)")
    structure.add_argument("file", metavar="FILE", help="universal file with the modes")
    structure.add_argument("--cavity", metavar="POINT", required=True, help="point of the cavity, such as 12Z")
    structure.add_argument("--drive", metavar="POINT", help="point of the force; default: that of the cavity")
    structure.add_argument("--units", metavar="SI", help="units of a file that does not state them")
    structure.add_argument("--out", metavar="FILE", help="scene file to write; without it, the scene is printed")
    return _structure(parser.parse_args(given))


def _structure(given: argparse.Namespace) -> int:
    try:
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            text = scene_from_uff(given.file, given.cavity, given.drive or given.cavity, units=given.units)
        for note in noted:
            print(f"warning: {note.message}", file=sys.stderr)
        if given.out is None:
            return _printed(text, sys.stdout)
        partial = Path(f"{given.out}.partial")
        partial.write_text(text, encoding="utf-8")
        partial.replace(given.out)
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _printed(text: str, stream: TextIO) -> int:
    """Print a text, and return the exit code; a reader that closes early, such as `head`, is not a failure."""
    try:
        print(text, end="", file=stream, flush=True)
    except OSError as error:
        # Python writes what is left at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        if not isinstance(error, BrokenPipeError):
            os.write(2, f"error: cannot write the result: {error}\n".encode())
            return 1
    return 0


def _run() -> int:
    """`main`, which ends upon a signal as `vines` does: with 130 for Ctrl-C (SIGINT), and 143 for SIGTERM."""

    def interrupt(number: int, _: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number))

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)
    try:
        return main()
    except KeyboardInterrupt as interrupted:
        number = interrupted.args[0] if interrupted.args else signal.SIGINT
        print(f"error: interrupted by {number.name}", file=sys.stderr)
        return 128 + number


if __name__ == "__main__":
    sys.exit(_run())
