"""CVODE with its functions in C: compiles benchmarks/c/cvode.c where SUNDIALS is installed, and answers requests.

    python cvode_c.py SCENES.json FOLDER     the program goes into FOLDER

Debian's package is libsundials-dev; a copy elsewhere is found with CPATH, LIBRARY_PATH and LD_LIBRARY_PATH.
"""

import json
import os
import subprocess
import sys
from itertools import groupby
from pathlib import Path

from scenes import load

SOURCE = Path(__file__).resolve().parent.parent / "c/cvode.c"
# Static archives need the last two; SUNDIALS 7 calls the common part sundials_core.
LIBRARIES = (
    ["-lsundials_cvode", "-lsundials_nvecserial"],
    ["-lsundials_cvode", "-lsundials_nvecserial", "-lsundials_generic", "-lm"],
    ["-lsundials_cvode", "-lsundials_nvecserial", "-lsundials_core", "-lm"],
)


def compiled(folder):
    """The program, compiled anew; ends this process with a reason where that is not possible."""
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / "cvode"
    compiler = os.environ.get("CC", "cc")
    probe = subprocess.run(
        [compiler, "-E", "-xc", "-"], input="#include <cvode/cvode.h>\n", capture_output=True, text=True, check=False
    )
    if probe.returncode:
        sys.exit("SUNDIALS for C is not installed (Debian: libsundials-dev)")
    for libraries in LIBRARIES:
        command = [compiler, "-O2", "-std=gnu11", str(SOURCE), "-o", str(program), *libraries, "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return program
    lines = done.stderr.strip().splitlines() or ["no message"]
    sys.exit(f"benchmarks/c/cvode.c could not be compiled: {lines[-1]}")


def request_text(scene, request):
    """A request as the program reads it."""
    rig = [scene[key] for key in "Mkcmbr"]
    parts = [(*drive, len(list(equal))) for drive, equal in groupby(scene["drives"])]
    checks = request["checks"] or [len(scene["drives"])]
    head = [*rig, *scene["start"], request["setting"], request["limit"], request["budget"]]
    numbers = [*head, len(parts), *(x for part in parts for x in part), len(checks), *checks]
    return " ".join(repr(x) for x in numbers) + "\n"


def answer(process, scene, request):
    process.stdin.write(request_text(scene, request))
    process.stdin.flush()
    line = process.stdout.readline()
    if not line:
        raise SystemExit("the program ended")
    kind, _, rest = line.strip().partition(" ")
    reply = {"ns": [], "states": [], "impacts": 0, "failure": None}
    if kind != "ok":
        return reply | {"failure": rest}
    words = rest.split()
    impacts, runs = int(words[0]), int(words[1])
    ns, rest = words[2 : 2 + runs], words[3 + runs :]
    states = [[float(x) for x in rest[n : n + 4]] for n in range(0, len(rest), 4)]
    return reply | {"ns": [float(x) for x in ns], "states": states, "impacts": impacts}


def main():
    scenes = load(Path(sys.argv[1]))
    program = compiled(Path(sys.argv[2]))
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([str(program)], text=True, bufsize=1, **pipes) as process:
        version = process.stdout.readline().strip()
        print(json.dumps({"version": f"SUNDIALS {version} (C)"}), flush=True)
        for line in sys.stdin:
            request = json.loads(line)
            print(json.dumps(answer(process, scenes[request["scene"]], request)), flush=True)


if __name__ == "__main__":
    main()
