"""Masters that nobody here wrote lock where the lab's own loop does."""

import pytest

LOCKS = [
    ("cofmupy", "jacobi"),
    ("ecos", "system file"),
    ("ecos", "call by call"),
    ("fmpy", "system file"),
    ("fmuloader", "jacobi"),
    ("pathsim", "diagram"),
]


@pytest.mark.parametrize(("client", "variant"), LOCKS)
def test_a_master_locks_where_the_lab_does(bench, play, check_lock, client, variant):
    check_lock(f"{client}, {variant}", bench, play(client, variant, bench))


def test_iterations_with_rollback_lock_where_the_lab_does(bench_in_millimetres, play, check_lock):
    """The controller reads the end of its step instead of the start, response and base alike: their phase is the same.

    Where nothing moves by 1e-3 cofmupy does not iterate, and there the controller reads the start: response and base
    alike again, but its samples are no longer even. That is what is left of a difference.
    """
    bench = bench_in_millimetres
    tape = play("cofmupy", "iterative", bench)
    check_lock("cofmupy, iterative", bench, tape)
    assert tape.notes["rollbacks"] > 1.9 * bench.steps


def test_the_toolbox_finds_nothing_wrong_with_the_fmus(bench, play):
    assert play("toolbox", "check", bench).notes["complaints"] == []


@pytest.mark.parametrize("variant", ["container", "container with threads"])
def test_a_container_of_both_locks_where_the_lab_does(bench, play, check_lock, variant):
    play("toolbox", variant, bench)
    check_lock(f"fmu-manipulation-toolbox, {variant}", bench, play("fmpy", "container", bench))
