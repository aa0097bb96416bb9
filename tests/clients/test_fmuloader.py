"""fmuloader: the C functions and nothing else."""


def test_a_master_of_a_few_lines_locks_where_the_lab_does(bench, play, check_lock):
    check_lock("fmuloader", bench, play("fmuloader", "jacobi", bench))
