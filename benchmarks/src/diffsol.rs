//! The solver library diffsol: stopped by its root functions, restarted after every impact and at the end of every step.

use crate::baseline::rebound;
use crate::method::Failure;
use crate::scene::Step;
use crate::solvers::{Flight, Solver, acceleration};
use diffsol::{NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};

type Matrix = NalgebraMat<f64>;

/// So many impacts within a radian of the natural frequency are a stall.
const MOST_IMPACTS: f64 = 1000.0;

macro_rules! solver {
    ($(#[$meta:meta])* $name:ident, $solver:ident $(, $linear:ty)?) => {
        $(#[$meta])*
        pub struct $name;

        impl Solver for $name {
            fn step(flight: &mut Flight, step: &Step) -> Result<(), Failure> {
                let (p, y0, angle, omega) = (flight.p, flight.y, flight.angle, step.drive.omega);
                let pull = |t: f64, q1: f64, v1: f64| acceleration(&p, &step.drive, angle + omega * t, q1, v1);
                let wrong = |e: diffsol::error::DiffsolError| Failure(e.to_string());
                let problem = OdeBuilder::<Matrix>::new()
                    .rtol(flight.setting)
                    .atol([flight.setting])
                    .h0(0.01 * step.duration.min(1.0))
                    .rhs_implicit(
                        |x, _p, t, y| {
                            y[0] = x[1];
                            y[1] = pull(t, x[0], x[1]);
                            y[2] = x[3];
                            y[3] = 0.0;
                        },
                        |_x, _p, _t, v, y| {
                            y[0] = v[1];
                            y[1] = -(p.stiffness * v[0] + p.damping * v[1]) / p.primary_mass;
                            y[2] = v[3];
                            y[3] = 0.0;
                        },
                    )
                    .init(|_p, _t, y| (0..4).for_each(|n| y[n] = y0[n]), 4)
                    .root(
                        |x, _p, _t, g| {
                            g[0] = p.half_width - (x[0] - x[2]);
                            g[1] = p.half_width + (x[0] - x[2]);
                        },
                        2,
                    )
                    .build()
                    .map_err(wrong)?;
                let mut solver = problem.$solver$(::<$linear>)?().map_err(wrong)?;
                solver.set_stop_time(step.duration).map_err(wrong)?;
                let most = MOST_IMPACTS * (1.0 + step.duration * p.natural_frequency());
                let mut impacts = 0.0;
                loop {
                    match solver.step().map_err(wrong)? {
                        OdeSolverStopReason::InternalTimestep => {}
                        OdeSolverStopReason::TstopReached => break,
                        OdeSolverStopReason::RootFound(t, _) => {
                            solver.state_mut_back(t).map_err(wrong)?;
                            let state = solver.state_mut();
                            let y = &mut *state.y;
                            // A root that the particle leaves is the one that this flight began at.
                            if (y[0] - y[2]) * (y[1] - y[3]) > 0.0 {
                                (y[1], y[3]) = rebound(&p, y[1], y[3]);
                                flight.impacts += 1;
                                impacts += 1.0;
                            }
                            let (q1, v1, v3) = (y[0], y[1], y[3]);
                            let dy = &mut *state.dy;
                            dy[0] = v1;
                            dy[1] = pull(t, q1, v1);
                            dy[2] = v3;
                            dy[3] = 0.0;
                            if impacts > most {
                                flight.time += t;
                                return Err(flight.stalled());
                            }
                            if t >= step.duration {
                                break;
                            }
                            solver.set_stop_time(step.duration).map_err(wrong)?;
                        }
                    }
                }
                let y = solver.state().y;
                flight.y = [y[0], y[1], y[2], y[3]];
                flight.time += step.duration;
                flight.angle = angle + omega * step.duration;
                Ok(())
            }
        }
    };
}

solver!(
    /// The explicit Runge-Kutta method of order 5.
    Tsit45, tsit45
);
solver!(
    /// The backward differentiation formulae.
    Bdf, bdf, NalgebraLU<f64>
);
