"""fmu-manipulation-toolbox: a checker, and a maker of containers."""

import pytest


def test_the_toolbox_finds_nothing_wrong_with_the_fmus(bench, play):
    assert play("toolbox", "check", bench).notes["complaints"] == []


@pytest.mark.parametrize("variant", ["container", "container with threads"])
def test_a_container_of_both_locks_where_the_lab_does(bench, play, check_lock, variant):
    play("toolbox", variant, bench)
    check_lock(f"fmu-manipulation-toolbox, {variant}", bench, play("fmpy", "container", bench))
