"""`python -m vines fit record.mat --response y --drive x`: `vines fit` for all formats of recordings.

`python -m vines structure modes.uff --cavity 12Z --drive 3Z`: a scene with the structure of a modal test.
"""

import argparse
import sys
import warnings
from pathlib import Path

from . import Scene, fit_recordings, linear_decay, read_recording, scene_from_uff


def main() -> int:
    """Fit a rig to recordings, or convert the modes of a structure to a scene, and print the result."""
    parser = argparse.ArgumentParser(prog="python -m vines", description=__doc__)
    parser.add_argument("command", choices=["fit", "structure"])
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help="recordings: CSV, MAT, HDF5, TDMS, UFF58 or LVM; of structure: one UFF55",
    )
    parser.add_argument("--response", metavar="NAME[:UNIT]", help="channel of the response")
    parser.add_argument(
        "--drive", metavar="NAME[:UNIT]", help="channel of the base; of structure: the point of the force"
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples a second")
    parser.add_argument("--late", type=float, metavar="SECONDS", help="how much later than the response the base is")
    parser.add_argument("--time", metavar="NAME[:UNIT]", help="channel of the time")
    parser.add_argument("--scene", metavar="FILE", help="scene file; without it, the default scene")
    parser.add_argument("--known", action="append", default=[], metavar="SYMBOL=VALUE±U", help="a value from elsewhere")
    parser.add_argument("--cavity", metavar="POINT", help="of structure: the point of the cavity, such as 12Z")
    parser.add_argument("--units", metavar="SI", help="of structure: the units of a file that does not state them")
    parser.add_argument(
        "--out", metavar="FILE", help="of structure: the scene file to write; without it, it is printed"
    )
    given = parser.parse_args()
    if given.command == "structure":
        return _structure(given)
    try:
        scene = Scene(given.scene)
        names = {key: getattr(given, key) for key in ("response", "drive", "rate", "time", "late")}
        recordings = [read_recording(file, **names) for file in given.files]
        for note in (note for one in recordings for note in one.notes):
            print(note)
        decays = [linear_decay(one, scene) for one in recordings]
        for one, decay in zip(recordings, decays, strict=True):
            if decay is not None:
                print(f"{one.origin}: {decay}")
        if None not in decays:
            return 0
        found = fit_recordings(recordings, scene, known=given.known)
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    doubt = "" if found.describes else " (rejected)"
    columns = (found.parameters[name] for name in ("symbol", "unit", "value", "uncertainty", "expected"))
    for symbol, unit, value, uncertainty, expected in zip(*columns, strict=True):
        print(f"{symbol:8} {value:.6g} ± {uncertainty:.2g} {unit}{doubt}, the scene says {expected:.6g}")
    print(f"{len(found.residuals)} points; chi-square {found.chi_square:.1f} for {found.degrees} degrees of freedom")
    if found.undetermined:
        print(f"the recordings do not determine {', '.join(found.undetermined)}: record at least three levels")
    for response in (verdict["linear"] for verdict in found.linear):
        print(f"linear response: f0 = {response['f0_Hz']:.6g} Hz, particle {response['particle']}")
    if found.effects is not None:
        print(f"explained by {found.explained_by or 'no single effect'}")
    for effect, b in zip(*(found.alternatives.get(name, ()) for name in ("effect", "possible_b_m")), strict=True):
        print(f"{effect} would give the same points with b = {1e3 * b:.4g} mm; give --known b and --known epsilon")
    return 0 if found.describes else 1


def _structure(given: argparse.Namespace) -> int:
    try:
        if len(given.files) != 1 or not given.cavity:
            raise ValueError("structure needs one file and --cavity POINT; --drive POINT is the cavity unless given")
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            text = scene_from_uff(given.files[0], given.cavity, given.drive or given.cavity, units=given.units)
        for note in noted:
            print(f"warning: {note.message}", file=sys.stderr)
        if given.out is None:
            print(text, end="")
        else:
            Path(given.out).write_text(text, encoding="utf-8")
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
