"""A program that answers requests, a line of JSON each, and is killed when it does not."""

import json
import os
import select
import subprocess
from pathlib import Path


class Missing(Exception):
    """A peer that cannot be started, and why."""


class Worker:
    """One side of the comparison; `hello` is the line that it begins with, if it does."""

    def __init__(self, command, greets):
        self.command, self.greets = [str(part) for part in command], greets
        self.process = None
        self.hello = {}
        self.start()

    def start(self):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        # The libraries are built. A program that has cargo see to that once more would have them made anew, with the
        # features that they have alone: in the middle of the run, and at the next one back again.
        environment = os.environ | {"CARGO": "true"}
        self.process = subprocess.Popen(self.command, text=True, bufsize=1, env=environment, **pipes)
        if self.greets:
            line = self.process.stdout.readline()
            if not line:
                error = self.process.stderr.read().strip().splitlines() or ["it ended without a word"]
                raise Missing(error[-1])
            self.hello = json.loads(line)

    def ask(self, request, limit):
        """The answer, or None after `limit` seconds; the program is then started anew."""
        try:
            self.process.stdin.write(json.dumps(request) + "\n")
            self.process.stdin.flush()
            ready, _, _ = select.select([self.process.stdout], [], [], limit)
            line = self.process.stdout.readline() if ready else None
        except BrokenPipeError:
            line = ""
        if line:
            return json.loads(line)
        self.process.kill()
        _, error = self.process.communicate()
        self.start()
        if line is None:
            return None
        return {"ns": [], "failure": "crashed: " + (error.strip().splitlines() or ["without a word"])[-1]}

    def processor_seconds(self):
        """Processor time of this program and of those that it started, s."""
        return sum(seconds(pid) for pid in [self.process.pid, *children(self.process.pid)])

    def end(self):
        self.process.kill()
        self.process.communicate()


def children(pid):
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def seconds(pid):
    """Processor time of a process and of the ended ones that it waited for."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
