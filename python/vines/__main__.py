"""`python -m vines fit record.mat --response y --drive x`: `vines fit` for all formats of recordings."""

import argparse
import sys

from . import Scene, fit_recordings, linear_decay, read_recording


def main() -> int:
    """Fit a rig to recordings, and print what was found."""
    parser = argparse.ArgumentParser(prog="python -m vines", description=__doc__)
    parser.add_argument("command", choices=["fit"])
    parser.add_argument("files", nargs="+", metavar="FILE", help="recordings: CSV, MAT, HDF5, TDMS, UFF58 or LVM")
    parser.add_argument("--response", metavar="NAME[:UNIT]", help="channel of the response")
    parser.add_argument("--drive", metavar="NAME[:UNIT]", help="channel of the base")
    parser.add_argument("--rate", type=float, metavar="HZ", help="samples a second")
    parser.add_argument("--time", metavar="NAME[:UNIT]", help="channel of the time")
    parser.add_argument("--scene", metavar="FILE", help="scene file; without it, the default scene")
    parser.add_argument("--known", action="append", default=[], metavar="SYMBOL=VALUE±U", help="a value from elsewhere")
    given = parser.parse_args()
    try:
        scene = Scene(given.scene)
        names = {"response": given.response, "drive": given.drive, "rate": given.rate, "time": given.time}
        recordings = [read_recording(file, **names) for file in given.files]
        for note in (note for one in recordings for note in one.notes):
            print(note)
        decays = [linear_decay(one, scene) for one in recordings]
        for one, decay in zip(recordings, decays, strict=True):
            if decay is not None:
                print(f"{one.origin}: {decay}")
        recordings = [one for one, decay in zip(recordings, decays, strict=True) if decay is None]
        if not recordings:
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
    if found.verdict:
        print(found.verdict)
    return 0 if found.describes else 1


if __name__ == "__main__":
    sys.exit(main())
