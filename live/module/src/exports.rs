//! The C exports. The page writes settings into [`settings_address`] and reads results from [`output_address`].
//!
//! | call | result in the output array |
//! |---|---|
//! | [`run`] | rows of the record: time (s), base, response, relative displacement (m), phase error (degrees), frequency of the drive (rad/s), base amplitude, response amplitude (m), frequency of the motion (rad/s), speed of the particle (m/s), 1 in a free decay along the backbone |
//! | [`look`] | time (s), base, q1, q2, relative displacement (m), particle's velocity (m/s), wall that it rests on (-1, 0, 1), impacts since the start |
//! | [`status`] | see there |
//! | [`manifold`] | triples (B, C, 1 if stable) |
//! | [`theory_backbone`] | triples (sigma, C, 1 if stable) |
//! | [`exact_backbone`] | quadruples (sigma, C, 1 if stable, G) |
//! | [`regime`] | the number of the regime |
//! | [`tracked`] | quintuples (time it is known, s; sigma; C; G; 1 if settled) |

use std::cell::RefCell;

use vines_bench::live::HarmonicMotion;
use vines_model::curves;
use vines_model::regime::Regime;

use crate::bench::{Bench, regime_at};
use crate::message::Message;
use crate::settings::{COUNT, Settings};

/// Largest number of values of one call.
const CAPACITY: usize = 1 << 16;
/// Columns of a row of the record.
const ROW_COLUMNS: usize = 11;

struct Page {
    // Boxed: bytes of zeros for a bench would be a part of the module.
    bench: Option<Box<Bench>>,
    settings: Settings,
    output: Vec<f64>,
    message: String,
}

thread_local! {
    // A page has one bench and one thread.
    static PAGE: RefCell<Page> = const {
        RefCell::new(Page { bench: None, settings: [0.0; COUNT], output: Vec::new(), message: String::new() })
    };
}

/// Does something with the page, and returns how many values are in the output array then; -1 and a message at an error. Compiled once.
#[inline(never)]
fn on_page(action: &mut dyn FnMut(&mut Page) -> Result<(), Message>) -> i32 {
    PAGE.with_borrow_mut(|page| {
        page.output.clear();
        page.output.reserve_exact(CAPACITY);
        match action(page) {
            Ok(()) => page.output.len() as i32,
            Err(error) => {
                (page.message, page.output) = (error.text, error.numbers);
                -1
            }
        }
    })
}

/// Fills the output array with values of the bench.
fn values(mut action: impl FnMut(&mut Bench, &mut Vec<f64>) -> Result<(), Message>) -> i32 {
    on_page(&mut |page| match &mut page.bench {
        Some(bench) => action(bench, &mut page.output),
        None => Err("restart first".into()),
    })
}

/// Address of the settings, `f64` each, in the order and the units of lab/page/settings.json. The first call fills in the default
/// scene.
// SAFETY of the exported names: none of them is a symbol of the C library or of the Rust runtime.
#[unsafe(no_mangle)]
pub extern "C" fn settings_address() -> *mut f64 {
    PAGE.with_borrow_mut(|page| {
        if page.bench.is_none() {
            page.settings = Bench::default_settings();
        }
        page.settings.as_mut_ptr()
    })
}

/// Address of the output array, `f64` each.
#[unsafe(no_mangle)]
pub extern "C" fn output_address() -> *const f64 {
    PAGE.with_borrow(|page| page.output.as_ptr())
}

/// Address of the message of the last error, UTF-8; each `{}` in it stands for a number of the output array.
#[unsafe(no_mangle)]
pub extern "C" fn message_address() -> *const u8 {
    PAGE.with_borrow(|page| page.message.as_ptr())
}

/// Length of that message, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn message_length() -> usize {
    PAGE.with_borrow(|page| page.message.len())
}

/// A bench at the start of the settings. Returns 0, or -1 and a message.
#[unsafe(no_mangle)]
pub extern "C" fn restart() -> i32 {
    on_page(&mut |page| {
        page.bench = Some(Box::new(Bench::new(page.settings)?));
        Ok(())
    })
}

/// Applies the settings to the running bench. Returns 0, or -1 and a message.
#[unsafe(no_mangle)]
pub extern "C" fn apply() -> i32 {
    on_page(&mut |page| match &mut page.bench {
        Some(bench) => bench.apply(page.settings),
        None => Err("restart first".into()),
    })
}

/// Switches the drive on (not 0) or off.
#[unsafe(no_mangle)]
pub extern "C" fn drive(on: i32) -> i32 {
    values(|bench, _| {
        bench.drive(on != 0);
        Ok(())
    })
}

/// Puts the primary mass (not 0) or the particle (0) at `to`, over b, at rest; see [`Bench::place`].
#[unsafe(no_mangle)]
pub extern "C" fn place(primary: i32, to: f64) -> i32 {
    values(|bench, _| bench.place(primary != 0, to))
}

/// Takes `samples` samples; returns the number of values of their rows.
#[unsafe(no_mangle)]
pub extern "C" fn run(samples: u32) -> i32 {
    values(|bench, output| {
        bench.run((samples as usize).min(CAPACITY / ROW_COLUMNS), |row| {
            let controller = &row.output;
            output.extend([
                row.time,
                row.base,
                row.response,
                row.relative,
                controller.phase_error.unwrap_or(0.0).to_degrees(),
                row.drive.omega,
                row.drive.amplitude,
                row.motion.amplitude,
                row.motion.omega,
                row.motion.speed,
                f64::from(u8::from(row.decays)),
            ]);
        })
    })
}

/// The plant `ahead` seconds after the last sample, at most one sample period.
#[unsafe(no_mangle)]
pub extern "C" fn look(ahead: f64) -> i32 {
    values(|bench, output| {
        let step = bench.controller.lock.config().sample_time;
        let ahead = ahead.clamp(0.0, step);
        let plant = bench.between(ahead);
        let state = plant.state();
        let wall = plant.contact().map_or(0.0, |_| plant.relative_displacement().signum());
        output.extend([
            bench.time() - step + ahead,
            plant.base_displacement(),
            state.q1,
            state.q2,
            plant.relative_displacement(),
            state.dq2,
            wall,
            plant.totals().impacts as f64,
        ]);
        Ok(())
    })
}

/// Time from the last sample to its first impact later than `after` seconds, s; 0 values if there is none before the next sample.
#[unsafe(no_mangle)]
pub extern "C" fn next_impact(after: f64) -> i32 {
    values(|bench, output| {
        output.extend(bench.first_impact(after).map(|(t, _)| t));
        Ok(())
    })
}

/// The numbers of the page: time (s), sample time (s), omega0 (rad/s), sigma, C, B, phase error (degrees), G, locked, settled, state
/// and fault of the loop, impacts since the start, impacts per period, energy dissipated (J); phase errors below which the loop is
/// locked, and above which the lock is lost (degrees).
#[unsafe(no_mangle)]
pub extern "C" fn status() -> i32 {
    values(|bench, output| {
        let (d, out) = (bench.scene.dimensionless(), bench.output);
        let closed = bench.settings[crate::settings::index::CLOSED] != 0.0;
        let HarmonicMotion { omega, amplitude, .. } = bench.motion;
        let totals = bench.plant().totals();
        let lock = bench.controller.lock.config().lock;
        let yes = |condition: bool| f64::from(u8::from(condition));
        output.extend([
            bench.time(),
            bench.controller.lock.config().sample_time,
            d.omega0,
            d.sigma(omega),
            amplitude / d.b,
            bench.particle_speed(),
            out.phase_error.unwrap_or(0.0).to_degrees(),
            d.excitation(bench.drive_amplitude()),
            yes(out.locked && closed),
            yes(out.settled && closed),
            f64::from(out.state as u8),
            out.fault.map_or(0.0, |fault| f64::from(fault as u8)),
            totals.impacts as f64,
            bench.rig.impacts.per_period(),
            totals.dissipated,
            lock.phase_tolerance.to_degrees(),
            lock.unlock_tolerance.to_degrees(),
        ]);
        Ok(())
    })
}

/// Puts the name of the regime and the fault of the loop (or nothing) into the message, separated by `|`.
#[unsafe(no_mangle)]
pub extern "C" fn words() {
    PAGE.with_borrow_mut(|page| {
        if let Some(bench) = &page.bench {
            let fault = bench.output.fault.map_or("", |fault| fault.text());
            page.message = [bench.regime().name(), "|", fault].concat();
        }
    });
}

/// `points` points of the slow invariant manifold up to `b_max`.
#[unsafe(no_mangle)]
pub extern "C" fn manifold(b_max: f64, points: u32) -> i32 {
    values(|bench, output| {
        output.extend(curves::manifold(&bench.scene.dimensionless(), b_max, points as usize).flatten());
        Ok(())
    })
}

/// `points` points of the backbone by first-order theory.
#[unsafe(no_mangle)]
pub extern "C" fn theory_backbone(points: u32) -> i32 {
    values(|bench, output| {
        output.extend(curves::backbone(&bench.scene.dimensionless(), points as usize).flatten());
        Ok(())
    })
}

/// At most `points` points of the backbone by exact orbits.
#[unsafe(no_mangle)]
pub extern "C" fn exact_backbone(points: u32) -> i32 {
    values(|bench, output| {
        output.extend(curves::exact(&bench.scene.dimensionless(), points as usize).flatten());
        Ok(())
    })
}

/// The regime under a constant drive of detuning `sigma` and excitation `g`, from the start of the scene: 0 without impacts, 1 symmetric
/// 1:1, 2 asymmetric 1:1, 3 irregular.
#[unsafe(no_mangle)]
pub extern "C" fn regime(sigma: f64, g: f64) -> i32 {
    values(|bench, output| {
        output.push(match regime_at(&bench.scene, sigma, g)? {
            Regime::NoImpacts => 0.0,
            Regime::Symmetric => 1.0,
            Regime::Asymmetric => 2.0,
            _ => 3.0,
        });
        Ok(())
    })
}

/// Starts to track the backbone, level by level, from the present state.
#[unsafe(no_mangle)]
pub extern "C" fn track() -> i32 {
    values(|bench, _| bench.track())
}

/// The points of the tracked backbone, each with the time from which it is known.
#[unsafe(no_mangle)]
pub extern "C" fn tracked() -> i32 {
    values(|bench, output| {
        let step = bench.controller.lock.config().sample_time;
        for point in bench.tracking.iter().flat_map(|tracking| &tracking.points) {
            let settled = f64::from(u8::from(point.settled));
            output.extend([point.sample as f64 * step, point.sigma, point.c, point.g, settled]);
        }
        Ok(())
    })
}
