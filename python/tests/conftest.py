"""What all tests of the package need."""

import signal

import pytest


@pytest.fixture(autouse=True)
def interrupts():
    """Ctrl-C is heard, also by tests that a shell runs in the background: it starts them with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
