"""The libraries in the packed FMUs, platform by platform: their symbols, and whether they compute the same.

Called by scripts/test-platforms, which has packed and built everything; needs the standard library only.
"""

import argparse
import datetime
import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
SAMPLES = 40_000
LARGEST = 1_600_000
COMPONENTS = {"LoViNes": "lovines_fmu", "PhaseLock": "phase_lock_fmu"}
# What every Windows since 8.1, and every Linux of 2012 or later, brings along.
SYSTEM = {
    "dll": {
        "kernel32.dll",
        "ntdll.dll",
        "msvcrt.dll",
        "bcryptprimitives.dll",
        "api-ms-win-core-synch-l1-2-0.dll",
        "ws2_32.dll",
        "userenv.dll",
    },
    "so": {
        "libc.so.6",
        "libm.so.6",
        "libdl.so.2",
        "libpthread.so.0",
        "libgcc_s.so.1",
        "ld-linux-x86-64.so.2",
        "ld-linux-aarch64.so.1",
    },
}
WINE = "/usr/lib/wine/wine64"
MARK = "<!-- platforms: scripts/test-platforms --keep writes what is between these marks -->"
END = "<!-- /platforms -->"


class Failure(Exception):
    """What is wrong with a library."""


def output(*command: str | Path, environment: dict[str, str] | None = None, folder: Path | None = None) -> str:
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        errors="replace",
        env=os.environ | (environment or {}),
        cwd=folder,
        timeout=1200,
    )
    if done.returncode != 0:
        words = " ".join(map(str, command))
        raise Failure(f"`{words}` ended with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def functions() -> set[str]:
    """The functions of FMI 2.0, as the boundary's table has them."""
    source = (ROOT / "tests" / "boundary" / "src" / "functions.rs").read_text()
    return set(re.findall(r"^    (fmi2\w+)\(", source, re.MULTILINE))


@dataclass
class Library:
    """A library as it is packed."""

    path: Path

    @property
    def kind(self) -> str:
        return self.path.suffix[1:]

    def exported(self) -> set[str]:
        if self.kind == "dll":
            table = self._headers().partition("[Ordinal/Name Pointer] Table")[2].partition("\n\n")[0]
            return set(re.findall(r"\] (?:\+base\[ *\d+\] +[0-9a-f]+ )?(\S+)$", table, re.MULTILINE))
        symbols = output("readelf", "--wide", "--dyn-syms", self.path)
        return set(re.findall(r" (?:GLOBAL|WEAK|UNIQUE) +DEFAULT +(?!UND)\S+ (\S+)$", symbols, re.MULTILINE))

    def imported(self) -> set[str]:
        if self.kind == "dll":
            return {name.lower() for name in re.findall(r"DLL Name: (\S+)", self._headers())}
        return set(re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "--wide", "--dynamic", self.path)))

    def is_stripped(self) -> bool:
        if self.kind == "dll":
            sections = output("x86_64-w64-mingw32-objdump", "-h", self.path)
            symbols = output("x86_64-w64-mingw32-objdump", "-t", self.path)
            return ".debug" not in sections and "no symbols" in symbols
        sections = output("readelf", "--wide", "--sections", self.path)
        return ".symtab" not in sections and ".debug" not in sections

    def glibc(self) -> str | None:
        """The newest glibc that it asks for."""
        if self.kind == "dll":
            return None
        versions = re.findall(r"@GLIBC_(\d+)\.(\d+)", output("readelf", "--wide", "--dyn-syms", self.path))
        return ".".join(map(str, max((int(major), int(minor)) for major, minor in versions)))

    def _headers(self) -> str:
        return output("x86_64-w64-mingw32-objdump", "-p", self.path)

    def check(self) -> None:
        name = self.path.name
        expected = functions()
        if self.exported() != expected:
            raise Failure(f"{name} exports {sorted(self.exported() ^ expected)} too many or too few")
        if foreign := self.imported() - SYSTEM[self.kind]:
            raise Failure(f"{name} needs {sorted(foreign)}, which not every system has")
        if not self.is_stripped():
            raise Failure(f"{name} holds symbols for a debugger")
        if self.size > LARGEST:
            raise Failure(f"{name} takes {self.size} bytes; allowed are at most {LARGEST}")
        for folder in (str(ROOT), str(Path.home())):
            if folder.encode() in self.path.read_bytes():
                raise Failure(f"{name} names the folder {folder} of this machine")

    @property
    def size(self) -> int:
        return self.path.stat().st_size


@dataclass
class Platform:
    """A folder of the FMUs, with what runs programs for it."""

    folder: str
    triple: str
    work: Path
    built: Path

    @property
    def home(self) -> Path:
        """Where the libraries lie, as packed, beside the programs that load them."""
        return self.work / self.folder

    @property
    def suffix(self) -> str:
        return ".dll" if self.folder.startswith("win") else ".so"

    def libraries(self) -> dict[str, Library]:
        """Takes them out of the FMUs."""
        self.home.mkdir(exist_ok=True)
        found = {}
        for component in COMPONENTS:
            with zipfile.ZipFile(self.work / "fmus" / f"{component}.fmu") as fmu:
                content = fmu.read(f"binaries/{self.folder}/{component}{self.suffix}")
            path = self.home / f"{component}{self.suffix}"
            path.write_bytes(content)
            found[component] = Library(path)
        return found

    def rebuilt(self, component: str) -> Path:
        """The library that was built from the same sources in another folder."""
        prefix = "" if self.suffix == ".dll" else "lib"
        name = f"{prefix}{COMPONENTS[component]}{self.suffix}"
        return self.built / self.triple / "release" / name

    def prepare(self) -> None:
        for program in ("couple", "stress"):
            name = program + (".exe" if self.suffix == ".dll" else "")
            shutil.copy(self.built / self.triple / "release" / name, self.home / name)
        if self.suffix == ".dll":
            source = Path(__file__).parent / "bcryptprimitives.c"
            stub = self.home / "bcryptprimitives.dll"
            output("x86_64-w64-mingw32-gcc", "-shared", "-O2", "-o", stub, source, "-ladvapi32")

    def run(self, program: str, *arguments: str | int | Path) -> str:
        words = [str(argument) for argument in arguments]
        if self.suffix == ".dll":
            prefix = self.work / "wine"
            environment = {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
            return output(WINE, self.home / f"{program}.exe", *words, ".", environment=environment, folder=self.home)
        runner = ["qemu-aarch64-static", "-L", "/usr/aarch64-linux-gnu"] if self.folder == "aarch64-linux" else []
        return output(*runner, self.home / program, *words, self.home)


@dataclass
class Row:
    """What was found on one platform."""

    platform: str
    sizes: list[int]
    symbols: int
    glibc: str | None
    hash: str
    sequences: int
    calls: int


def examine(platform: Platform, sequences: int, once: bool) -> Row:
    libraries = platform.libraries()
    for component, library in libraries.items():
        library.check()
        if not once and platform.rebuilt(component).read_bytes() != library.path.read_bytes():
            raise Failure(f"{library.path.name} is not the same where it is built in another folder")
    platform.prepare()
    coupled = platform.run("couple", SAMPLES)
    hashed = re.search(r"^sha256 ([0-9a-f]{64})$", coupled, re.MULTILINE)
    if hashed is None or "locked: true" not in coupled:
        raise Failure(f"the pair has not locked:\n{coupled}")
    fuzzed = platform.run("stress", sequences, 1)
    if "no crash, no panic" not in fuzzed:
        raise Failure(f"the call fuzzer has come to no end:\n{fuzzed}")
    calls = sum(int(line.split()[2]) for line in fuzzed.splitlines() if line.split()[:1] in ([n] for n in COMPONENTS))
    glibc = {library.glibc() for library in libraries.values()} - {None}
    return Row(
        platform.folder,
        [library.size for library in libraries.values()],
        len(functions()),
        max(glibc, default=None, key=lambda text: tuple(map(int, text.split(".")))),
        hashed[1],
        sequences,
        calls,
    )


def table(rows: list[Row]) -> str:
    text = "<!-- not made by a command: `scripts/test-platforms` prints it -->\n"
    text += "| platform | LoViNes, PhaseLock | symbols exported | glibc | hash of 40 000 samples | fuzzed calls |\n"
    text += "|---|---|---|---|---|---|\n"
    for row in rows:
        sizes = ", ".join(f"{size / 1e6:.2f} MB" for size in row.sizes)
        calls = f"{row.calls:,}".replace(",", " ")
        cells = [row.platform, sizes, f"{row.symbols} each", row.glibc or "none", f"`{row.hash[:16]}…`", calls]
        text += f"| {' | '.join(cells)} |\n"
    return text


def keep(path: Path, text: str) -> None:
    page = path.read_text()
    before, rest = page.split(MARK)
    after = rest.split(END)[1]
    today = datetime.date.today()
    words = f"On {today.day} {today:%B %Y}:\n\n{text}"
    new = path.with_suffix(".new")
    new.write_text(f"{before}{MARK}\n{words}{END}{after}")
    new.replace(path)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--built", type=Path, required=True)
    parser.add_argument("--sequences", type=int, required=True)
    parser.add_argument("--once", action="store_true", help="there is no second build to compare with")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("platforms", nargs="+", help="folder in the FMUs and Rust's name, joined by =")
    given = parser.parse_args()
    rows, failed = [], False
    for words in given.platforms:
        folder, triple = words.split("=")
        try:
            rows.append(examine(Platform(folder, triple, given.work, given.built), given.sequences, given.once))
            print(f"{folder}: passed", flush=True)
        except (Failure, subprocess.TimeoutExpired, OSError, KeyError) as failure:
            failed = True
            print(f"{folder}: {failure}", file=sys.stderr, flush=True)
    print(table(rows))
    if len({row.hash for row in rows}) > 1:
        failed = True
        print("the platforms do not compute the same bits", file=sys.stderr)
    if failed:
        return 1
    if given.keep:
        keep(given.keep, table(rows))
    print("all platforms passed: the same bits, the functions of FMI and no other symbol, system libraries only")
    return 0


if __name__ == "__main__":
    sys.exit(main())
