"""The book: links lead somewhere, sentences are short, commands run, and generated pages are up to date."""

import importlib.util
import re
import shutil
import socket
import subprocess
import textwrap
import time
from pathlib import Path

import pytest

from references import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(set(DOCS.glob("*.md")) - {DOCS / "SUMMARY.md"})
# Pages written by hand: lines of one, and of all with the README, without comments; words of a sentence.
MOST_LINES = 200
MOST_LINES_IN_ALL = 2750
# Written by tests of the controller and of the plant, and by scripts/notebooks.py.
MADE = ("controller-settings.md", "plant-parameters.md", "gallery.md")
MOST_WORDS = 37
README = ROOT / "README.md"
GENERATED = DOCS / "reference"

spec = importlib.util.spec_from_file_location("reference", ROOT / "scripts" / "reference.py")
reference = importlib.util.module_from_spec(spec)
spec.loader.exec_module(reference)


def blocks(page: Path) -> list[tuple[str, str]]:
    """Code blocks: kind and text."""
    return re.findall(r"^```([\w,]*)\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE)


def prose(text: str) -> str:
    """The text without code blocks, comments and formulas."""
    text = re.sub(r"^```.*?^```$|<!--.*?-->", "\n", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"^    .*$", "\n", text, flags=re.MULTILINE)


def sentences(text: str) -> list[str]:
    paragraphs = re.split(r"\n\s*\n|\n(?=\s*(?:[-*|#>]|\d+\.) ?)", prose(text))
    cells = [cell for paragraph in paragraphs for cell in re.split(r"(?<!\\)\|", paragraph)]
    end = r"(?<=[.!?:])[*_]*\s+(?=[`\[]|\W*[A-Z0-9])"
    return [one for cell in cells for one in re.split(end, " ".join(cell.split()))]


def anchors(page: Path) -> set[str]:
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", [README, *sorted(DOCS.rglob("*.md"))], ids=lambda page: page.name)
def test_every_link_of_a_page_leads_somewhere(page):
    text = re.sub(r"^```.*?^```$|`[^`\n]*`", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?://|rust/|live/|notebooks/", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), f"{page.name}: {link}"
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), f"{page.name}: {link}"


@pytest.mark.parametrize("page", [README, *PAGES], ids=lambda page: page.name)
def test_no_sentence_of_a_page_is_long(page):
    long = [one for one in sentences(page.read_text()) if len(one.split()) > MOST_WORDS]
    assert not long


def test_the_book_contains_every_page_and_is_short():
    lengths = {
        page.name: sum(not line.startswith("<!--") for line in page.read_text().splitlines())
        for page in (README, *PAGES)
        if page.name not in MADE
    }
    assert {name: length for name, length in lengths.items() if length > MOST_LINES} == {}
    assert sum(lengths.values()) <= MOST_LINES_IN_ALL
    listed = re.findall(r"\(([\w/-]+\.md)\)", (DOCS / "SUMMARY.md").read_text())
    pages = {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} - {"SUMMARY.md"}
    assert set(listed) == pages


def test_the_generated_pages_are_those_of_the_program(vines):
    written = {page.name: page.read_text() for page in GENERATED.glob("*.md")}
    assert reference.variables() == written["fmu-variables.md"]
    assert reference.python() == written["python-api.md"]
    assert reference.outputs(vines) == written["output-files.md"]
    for name, section in reference.commands(vines).items():
        if name != "vines":
            assert section in written["cli.md"], f"{name}: run scripts/docs"


def is_run(page: Path) -> bool:
    return any(kind.split(",")[0] == "sh" and "norun" not in kind for kind, _ in blocks(page))


class Shell:
    """Runs the commands of a page in a folder; servers end with it."""

    def __init__(self, vines: Path, folder: Path):
        self.vines, self.folder, self.servers, self.ports = vines, folder, [], {}

    def command(self, line: str) -> str:
        # The ports of the page may be in use.
        def port(match):
            if match[0] not in self.ports:
                with socket.create_server(("127.0.0.1", 0)) as free:
                    self.ports[match[0]] = str(free.getsockname()[1])
            return self.ports[match[0]]

        line = re.sub(r"\b55[12]\d\b", port, line)
        return re.sub(r"^vines\b", str(self.vines), line)

    def run(self, line: str, fails: bool) -> str:
        if line.endswith("&"):
            server = subprocess.Popen(
                ["bash", "-c", "exec " + self.command(line[:-1])],
                cwd=self.folder,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            self.servers.append(server)
            self.wait_for(next(int(mine) for theirs, mine in self.ports.items() if theirs in line))
            return ""
        done = subprocess.run(
            ["bash", "-c", self.command(line)], cwd=self.folder, capture_output=True, text=True, timeout=600
        )
        assert (done.returncode != 0) == fails, f"{line}\n{done.stdout}{done.stderr}"
        for folder in re.findall(r"(?:^|&& )cd (\S+)", line):
            self.folder = self.folder / folder
        return done.stdout + done.stderr

    def wait_for(self, port: int):
        """A connection would be a session: the tables of the system show that the port is open."""
        end = time.monotonic() + 120
        while time.monotonic() < end:
            tables = (Path("/proc/net/tcp").read_text(), Path("/proc/net/udp").read_text())
            if any(f":{port:04X} " in table for table in tables):
                return
            time.sleep(0.05)
        raise AssertionError(f"no server on port {port}")

    def close(self):
        for server in self.servers:
            server.kill()
            server.wait()


def tables(text: str) -> list[tuple[str, str]]:
    """Tables, each with the line above it that is not empty."""
    found, above, table = [], "", []
    for line in [*re.sub(r"^```.*?^```$", "```", text, flags=re.DOTALL | re.MULTILINE).splitlines(), ""]:
        if line.lstrip().startswith("|"):
            table.append(line)
        else:
            if table:
                found.append((above, "\n".join(table[2:])))
                table = []
            above = line.strip() or above
    return found


NUMBER = r"\d+(?:\.\d+)?(?:e[-+]?\d+|·10[⁻⁰¹²³⁴-⁹]+)?"


def numbers(text: str) -> list[str]:
    """Numbers, without their signs, of a text outside code, links and names of standards."""
    text = re.sub(r"`[^`]*`|\]\([^)]*\)|\bFMI \d\.\d", " ", text)
    return re.findall(rf"(?<![\w.,⁻₀]){NUMBER}(?![\w.]*\w)", text)


def value(number: str) -> tuple[float, float]:
    """A number and half a unit of its last digit."""
    number = number.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")).replace("·10", "e")
    mantissa, _, exponent = number.partition("e")
    digits = len(mantissa.partition(".")[2])
    if "." not in mantissa and len(mantissa) > 2:
        # The zeros at the end of a large number are no digits of it.
        digits = len(mantissa.rstrip("0")) - len(mantissa)
    return float(number), 0.5 * 10.0 ** (int(exponent or 0) - digits)


def is_made(text: str, above: str) -> bool:
    return bool(numbers(text)) and not above.startswith("<!-- not made by a command: ")


def numbered_tables() -> list:
    made = [
        pytest.param(above, rows, id=f"{page.name}-{count}")
        for page in (README, *PAGES)
        if page.name not in MADE
        for count, (above, rows) in enumerate(tables(page.read_text()))
        if is_made(rows, above)
    ]
    assert made
    return made


@pytest.mark.parametrize(("above", "rows"), numbered_tables())
def test_every_number_of_a_table_is_made_by_its_command_or_stands_in_its_file(above, rows, vines, tmp_path):
    source = re.fullmatch(r"<!-- (by|from): (.*) -->", above)
    assert source, f"say where the numbers come from, above the table: {rows}"
    if source[1] == "from":
        made = "\n".join((ROOT / name).read_text() for name in source[2].split())
    else:
        # Settings are numbers of a table, too.
        made = source[2] + output_of(source[2], vines, tmp_path)
    printed = [value(number)[0] for number in re.findall(NUMBER, made)]
    missing = []
    for number in numbers(rows):
        expected, tolerance = value(number)
        # A printed number is itself rounded.
        if not any(abs(one - expected) <= tolerance * (1 + 1e-9) for one in printed):
            missing.append(number)
    assert not missing, f"{source[0]}: {missing}"


def missing_lines(shown: str, output: str) -> list[str]:
    """Lines of a block that a program has not printed."""
    lines = [" ".join(line.split()) for line in output.splitlines()]
    shown = [" ".join(line.split()) for line in textwrap.dedent(shown).splitlines() if line.strip()]
    return [line for line in shown if line not in lines]


def output_of(commands: str, vines: Path, folder: Path) -> str:
    """What commands, separated by semicolons, print in a folder with the scenes."""
    shutil.copytree(ROOT / "scenes", folder / "scenes")
    shell = Shell(vines, folder)
    return "\n".join(shell.run(line.strip(), False) for line in commands.split(";"))


def printed_blocks() -> list[tuple[Path, str, str]]:
    """Text blocks of pages that no command of their page prints: page, line above, text."""
    found = []
    for page in (README, *PAGES):
        runs = False
        for above, kind, text in re.findall(
            r"^([^\n]*)\n```([\w,]*)\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE
        ):
            language, *flags = kind.split(",")
            runs = runs or (language == "sh" and "norun" not in flags and page != README)
            if language == "text" and (not runs or above.startswith("<!--")):
                found.append((page, above, text))
    return found


@pytest.mark.parametrize(("page", "above", "text"), printed_blocks())
def test_a_block_that_no_command_of_its_page_prints_says_what_does(page, above, text, vines, tmp_path):
    if above.startswith("<!-- not made by a command: "):
        return
    command = re.fullmatch("<!-- by: (.*) -->", above)
    assert command, f"{page.name}: say what prints this, in the line above: {text}"
    missing = missing_lines(text, output_of(command[1], vines, tmp_path))
    assert not missing, f"{page.name} shows what the program does not print: {missing}"


def git(*words: str | Path) -> str:
    return subprocess.run(["git", *words], check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("page", list(filter(is_run, PAGES)), ids=lambda page: page.name)
def test_the_commands_of_a_page_run_in_a_clone_print_what_it_shows_and_leave_the_clone_clean(page, vines, tmp_path):
    clone = tmp_path / "vines"
    git("clone", "--quiet", "--shared", ROOT, clone)
    shutil.copytree(ROOT / "scenes", clone / "scenes", dirs_exist_ok=True)
    before = git("-C", clone, "status", "--porcelain")
    shell, output = Shell(vines, clone), ""
    marked = {text for of, _, text in printed_blocks() if of == page}
    try:
        for kind, text in blocks(page):
            name = re.match(r"(?:#|/\*|<!--) (\w+\.\w+)\b", text)
            if name and "norun" not in kind:
                (shell.folder / name[1]).write_text(text)
            language, *flags = kind.split(",")
            if language == "sh" and "norun" not in flags:
                lines = text.replace("\\\n", " ").splitlines()
                output = "".join(
                    shell.run(line, "fails" in flags) for line in lines if line.strip() and not line.startswith("#")
                )
            elif language == "text" and output and text not in marked:
                missing = missing_lines(text, output)
                assert not missing, f"{page.name} shows what the program does not print: {missing}"
    finally:
        shell.close()
    assert git("-C", clone, "status", "--porcelain") == before
