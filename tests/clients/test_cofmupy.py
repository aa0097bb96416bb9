"""cofmupy: Jacobi, and Jacobi iterated with both FMUs rolled back to the start of the step."""


def test_jacobi_locks_where_the_lab_does(bench, play, check_lock):
    check_lock("cofmupy, Jacobi", bench, play("cofmupy", "jacobi", bench))


def test_iterations_with_rollback_lock_where_the_lab_does(bench_in_millimetres, play, check_lock):
    """The controller reads the end of its step instead of the start, response and base alike: their phase is the same.

    Where nothing moves by 1e-3 cofmupy does not iterate, and there the controller reads the start: response and base
    alike again, but its samples are no longer even. That is what is left of a difference.
    """
    bench = bench_in_millimetres
    tape = play("cofmupy", "iterative", bench)
    check_lock("cofmupy, iterative", bench, tape)
    assert tape.notes["rollbacks"] > 1.9 * bench.steps
