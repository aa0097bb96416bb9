"""Writes the generated pages in docs/reference/: command line, variables of the FMUs, output files, Python package.

python scripts/reference.py PROGRAM    PROGRAM is `vines`, built with all commands
"""

import ast
import csv
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
REFERENCE = ROOT / "docs" / "reference"
NOTE = "<!-- Written by scripts/reference.py; change its sources, not this page. -->\n"

# Meaning of every column and key of a result. `vines identify` and `vines backbone` have common ones.
COLUMNS = {
    "t_s": "time since the release, s",
    "f_Hz": "frequency of the response, Hz",
    "A_m": "amplitude of the first harmonic of the response, as a displacement at the sensor, m",
    "E_m": "amplitude of the base, m",
    "F_N": "amplitude of the force, N (structures that a force drives, instead of E_m)",
    "tau": "time since the release, omega0 t",
    "C": "amplitude of the response over b",
    "B": "speed of the particle over b omega0 (simulations only)",
    "sigma": "detuning, (omega/omega0 - 1)/epsilon",
    "G": "amplitude of the base over b epsilon",
    "rate": "dC/dtau",
    "sigma_theory": "sigma of the first-order backbone at the same C",
    "sigma_exact": "sigma of the exact backbone at the same C",
    "sigma_slow_flow": "sigma of the first-order decay with the drift of its manifold",
    "phase_target_deg": "controller.phase_target: phase of the response to the reference that is held, degrees",
    "phase_error_deg": "phase of the response to the reference, less its target, degrees",
    "level": "requested level, C",
    "periods": "periods spent on this level",
    "averaged": "periods that the result is averaged over",
    "unseen_growth": "growth of a disturbance per period, relative, that they would not show (from 1e-6 to 0.8 %)",
    "settled": "whether all uncertainties are within backbone.precision",
    "reached": "whether the response reached the level; if not, the drive is at a limit",
    "E_requested_m": "requested amplitude of the base, m; of a held base (chain.hold) what is left of it",
    "F_requested_N": "requested amplitude of the force, N (structures that a force drives, instead of E_requested_m)",
    "at_requested_drive": "whether E_m or F_N is the requested drive, within 1 % or three standard uncertainties",
    "held": "whether the response is under control at the lock, not the drive",
    "periods_to_lock": "periods from the start to the settled lock",
    "impacts_per_period": "impacts per period of the drive (simulations only)",
    "motion": "what the response shows: near the linear response, nonlinear and symmetric or not, or irregular",
    "regime_by_impacts": "regime by the impacts (simulations only)",
    "tone_Hz": "frequency of a foreign tone in the response, Hz",
    "tone_share": "its amplitude over the amplitude of the response",
    **{f"drive_{n}": f"harmonic {n} of the measured drive over the first, behind a shaker" for n in range(2, 8)},
    "clipped_percent": "share of the samples with the amplifier at its limit, behind a shaker",
    "command_V": "mean amplitude of the amplifier's command over the averaged periods, V, behind a shaker",
    "linear_f0_Hz": "natural frequency measured by the check of the loop, Hz, in this state of the particle",
    "linear_u_f0_Hz": "its standard uncertainty, Hz",
    "linear_zeta": "damping ratio measured there",
    "linear_u_zeta": "its standard uncertainty",
    "linear_correlation": "correlation of the two",
    "linear_particle": "state of the particle there: carried, free, or unknown",
    "distance": "distance from the nearest place of the exact backbone",
    "sigma_less_exact": "sigma less its value on the exact backbone at the same C",
    "G_less_exact": "G less its value on the exact backbone at the same C",
}
FILES = {
    "identification.json": (
        "identify",
        "all results of the experiment: parameters, lock, theory, exact orbits, decay, RMS errors",
    ),
    "backbone.csv": ("identify", "the free decay, one row per window of the fit"),
    "backbone.svg": ("identify", "C over sigma: decay, theory, exact orbits"),
    "history.svg": ("identify", "C and sigma over time: lock, hold and decay, with theory and exact orbit"),
    "sim.svg": ("identify", "the slow invariant manifold with the decay"),
    "tracked.json": ("backbone", "all results of the tracking"),
    "tracked.csv": ("backbone", "one row per level"),
    "tracked.svg": ("backbone", "C over sigma and over G: points with uncertainties, theory, exact orbits"),
    "map.csv": ("map", "one row per cell"),
    "map.svg": ("map", "the map"),
    "bifurcations.csv": ("map", "curves of bifurcations over sigma and G"),
}


def run(program, *words, **options):
    return subprocess.run([program, *words], capture_output=True, text=True, check=True, **options).stdout


def table(head, rows):
    def line(cells):
        return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"

    return "\n".join([line(head), "|" + "---|" * len(head), *(line(row) for row in rows)]) + "\n"


def commands(program):
    """Sections of the page on the command line, by command."""
    top = run(program, "--help")
    listed = re.findall(r"^  (\w+) (.*)", top.partition("Commands:")[2].partition("Options:")[0], re.MULTILINE)
    names = [name for name, _ in listed if name != "help"]
    texts = {"vines": top} | {f"vines {name}": run(program, name, "--help") for name in names}
    return {name: f"## {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in texts.items()}


def command_line(program):
    return "# Command line\n\n" + NOTE + "\n" + "\n".join(commands(program).values())


def variables():
    """Tables of the variables of both FMUs."""
    page = "# Variables of the FMUs\n\n" + NOTE
    for name, file in (("LoViNes", "modelDescription.xml"), ("PhaseLock", "controller/modelDescription.xml")):
        model = ElementTree.parse(ROOT / file).getroot()
        page += f"\n## {name}.fmu\n\n{model.get('description')}.\n"
        types = {kind.get("name"): kind[0] for kind in model.iter("SimpleType")}
        groups = {}
        for variable in model.iter("ScalarVariable"):
            value = variable[0]
            declared = types.get(value.get("declaredType"), value)
            low, high = (value.get(end, declared.get(end)) for end in ("min", "max"))
            groups.setdefault(variable.get("causality"), []).append(
                [
                    f"`{variable.get('name')}`",
                    value.tag,
                    value.get("unit", declared.get("unit", "")),
                    value.get("start", ""),
                    f"{low} to {high}" if low and high else f"from {low}" if low else f"up to {high}" if high else "",
                    variable.get("description"),
                ]
            )
        for causality in ("input", "output", "parameter", "calculatedParameter", "local", "independent"):
            if rows := groups.pop(causality, None):
                heading = causality.replace("calculatedP", "calculated p")
                page += f"\n### {name}: {heading}\n\n" + table(
                    ["name", "type", "unit", "start", "allowed", "meaning"], rows
                )
        assert not groups, groups
    return page


def meaning(column):
    if column.startswith("u_"):
        return (
            f"standard uncertainty of {column[2:].removesuffix('_deg')}{', degrees' if column.endswith('_deg') else ''}"
        )
    return COLUMNS.get(column, "")


def header(path):
    """Names of the columns of a CSV file."""
    with path.open(newline="") as file:
        return next(csv.reader(file))


def outputs(program):
    """Files that the commands write, and the columns of those with the measured points."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        run(program, "identify", "--rig", "built-in", "--out", out)
        run(program, "backbone", "--set", "backbone.points=8", "--out", out)
        shaken = ["--scene", ROOT / "scenes" / "shaker-cantilever.toml", "--out", out / "shaken"]
        run(program, "backbone", *shaken, "--set", "backbone.points=3")
        run(program, "identify", *shaken)
        grids = ["--x", "sigma=-2:-1:3", "--y", "G=1:1.2:3", "--periods", "200", "--confirmations", "0"]
        run(program, "map", *grids, "--out", out)
        page = "# Output files\n\n" + NOTE + "\n"
        page += "A file is complete or absent. JSON files have the same names as the columns.\n"
        page += "A value that does not exist is empty in CSV and `null` in JSON.\n\n"
        rows = [[f"`{name}`", f"`vines {command}`", text] for name, (command, text) in FILES.items()]
        files = {file.name for file in out.iterdir() if file.is_file()}
        missing, extra = FILES.keys() - files, files - FILES.keys() - {"LoViNes.fmu", "PhaseLock.fmu"}
        assert not missing | extra, f"scripts/reference.py describes other files than are written: {missing | extra}"
        page += table(["file", "written by", "content"], rows)
        for name in ("backbone.csv", "tracked.csv"):
            shaken = header(out / "shaken" / name) if name == "tracked.csv" else []
            columns = list(dict.fromkeys([*header(out / name), *shaken]))
            unknown = [column for column in columns if not meaning(column)]
            assert not unknown, f"scripts/reference.py has no meaning for the columns {unknown} of {name}"
            page += f"\n## {name}\n\n" + table(["column", "meaning"], [[f"`{one}`", meaning(one)] for one in columns])
        runs = [out, out / "shaken"]
        lock = {}
        for folder in runs:
            lock |= json.loads((folder / "identification.json").read_text())["lock"]
        unknown = [key for key in lock if not meaning(key)]
        assert not unknown, f"scripts/reference.py has no meaning for the keys {unknown} of the lock"
        page += "\n## identification.json: lock\n\n"
        page += table(["key", "meaning"], [[f"`{one}`", meaning(one)] for one in lock])
        page += "\n## map.csv\n\nColumns: " + ", ".join(f"`{one}`" for one in header(out / "map.csv"))
        return page + ". [Orbits and regimes](../regimes.md) defines them.\n"


SECTIONS = ("Parameters", "Attributes", "Returns", "Raises", "Examples", "Notes")


def markdown(docstring):
    """A docstring in NumPy's style as Markdown."""
    parts = re.split(rf"^({'|'.join(SECTIONS)})\n-+\n", docstring, flags=re.MULTILINE)
    text = parts[0].strip() + "\n"
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        body = body.strip("\n")
        if title == "Examples":
            text += f"\n```python\n{body}\n```\n"
            continue
        text += f"\n*{title}*\n\n"
        for entry in re.split(r"\n(?=\S)", body):
            name, _, rest = entry.partition("\n")
            name, _, kind = name.partition(" : ")
            described = " ".join(line.strip() for line in rest.splitlines() if line.strip())
            text += f"- `{name}`" + (f" ({kind})" if kind else "") + (f": {described}" if described else "") + "\n"
    return text


def signature(node):
    arguments = ast.unparse(node.args).removeprefix("self").removeprefix(", ")
    return f"{node.name}({arguments})"


def python():
    """The public names of the package, from the source: no compiled module is needed."""
    package = ROOT / "python" / "vines"
    start = ast.parse((package / "__init__.py").read_text())
    page = "# Python package\n\n" + NOTE + "\n" + ast.get_docstring(start) + "\n"
    public = next(
        ast.literal_eval(one.value)
        for one in start.body
        if isinstance(one, ast.Assign) and one.targets[0].id == "__all__"
    )
    nodes = {}
    for file in sorted(package.glob("*.py")):
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                nodes[node.name] = node
    for name in sorted((one for one in public if one in nodes), key=str.lower):
        node = nodes[name]
        documented = ast.get_docstring(node) or ""
        if isinstance(node, ast.FunctionDef):
            page += f"\n## {name}\n\n`{signature(node)}`\n\n{markdown(documented)}"
            continue
        page += f"\n## {name}\n\n{markdown(documented)}"
        for part in node.body:
            if isinstance(part, ast.FunctionDef) and not part.name.startswith("_") and ast.get_docstring(part):
                is_property = any(isinstance(one, ast.Name) and one.id == "property" for one in part.decorator_list)
                title = part.name if is_property else signature(part)
                page += f"\n**`{title}`** {markdown(ast.get_docstring(part))}"
    return page


def pages(program):
    return {
        "cli.md": command_line(program),
        "fmu-variables.md": variables(),
        "output-files.md": outputs(program),
        "python-api.md": python(),
    }


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    REFERENCE.mkdir(exist_ok=True)
    for name, text in pages(sys.argv[1]).items():
        (REFERENCE / name).write_text(re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE))
