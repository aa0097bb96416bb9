"""ecospy: a co-simulation engine in C++."""

import pytest


@pytest.mark.parametrize("variant", ["system file", "call by call"])
def test_the_engine_locks_where_the_lab_does(bench, play, check_lock, variant):
    check_lock(f"ecospy, {variant}", bench, play("ecos", variant, bench))
