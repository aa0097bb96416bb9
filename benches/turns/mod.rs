//! Two programs on the same work, timed in short turns: the state of the processor changes from second to second and meets both.

/// A turn lasts so long, ns: its median leaves out the first runs after the other program's turn, and what interrupts others.
const TURN: f64 = 2e6;

/// Nanoseconds per unit of work: the median of the runs of one turn. `run` returns the nanoseconds that it took and its units of work.
///
/// # Errors
/// Those of a run.
pub fn turn<E>(run: &mut impl FnMut() -> Result<(f64, f64), E>) -> Result<f64, E> {
    let (mut gone, mut costs) = (0.0, Vec::new());
    while gone < TURN {
        let (ns, work) = run()?;
        gone += ns;
        costs.push(ns / work);
    }
    let middle = costs.len() / 2;
    Ok(*costs.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Nanoseconds per unit of work of both programs in the `n`-th pair of turns; each begins every other pair.
///
/// # Errors
/// Those of a run.
pub fn pair<E>(
    n: usize,
    first: &mut impl FnMut() -> Result<(f64, f64), E>,
    second: &mut impl FnMut() -> Result<(f64, f64), E>,
) -> Result<[f64; 2], E> {
    if n.is_multiple_of(2) {
        let ns = turn(first)?;
        Ok([ns, turn(second)?])
    } else {
        let ns = turn(second)?;
        Ok([turn(first)?, ns])
    }
}
