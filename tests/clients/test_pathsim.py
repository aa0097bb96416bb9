"""pathsim-fmi: FMUs as blocks of a block diagram."""


def test_a_block_diagram_locks_where_the_lab_does(bench, play, check_lock):
    check_lock("pathsim-fmi", bench, play("pathsim", "diagram", bench))
