"""Figures that tests measure: checked against their limits, and printed as a table at the end."""

from collections.abc import Callable

import pytest

FIGURES = pytest.StashKey[list[tuple[str, str, str]]]()


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Notes a figure, which is at most `below`, or between two limits."""
    figures = request.config.stash[FIGURES]

    def figure(
        what: str, value: float, *, below: float | None = None, between: tuple[float, float] | None = None
    ) -> None:
        low, high = between or (-float("inf"), below)
        limit = f"{low:g} to {high:g}" if between else f"at most {high:g}"
        figures.append((what, f"{value:.4g}", limit))
        assert low <= value <= high, f"{what}: {value} is not {limit}"

    return figure


def pytest_configure(config: pytest.Config) -> None:
    config.stash[FIGURES] = []


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    figures = config.stash[FIGURES]
    if not figures:
        return
    terminalreporter.section("figures")
    rows = [("what", "figure", "limit"), *figures]
    wide = [max(len(row[n]) for row in rows) for n in range(2)]
    for what, value, limit in rows:
        terminalreporter.write_line(f"{what:<{wide[0]}}  {value:>{wide[1]}}  {limit}")
