//! The table: what was asked for, what came of it, what is allowed.

use std::time::Instant;

#[derive(Debug)]
pub struct Table {
    broken: Vec<String>,
    began: Instant,
}

impl Table {
    pub fn begin() -> Self {
        println!("| what | among | figure | allowed |\n|---|---|---|---|");
        Self {
            broken: Vec::new(),
            began: Instant::now(),
        }
    }

    /// A figure and the most that it may be.
    pub fn row(&mut self, what: &str, among: &str, figure: f64, allowed: f64) {
        let short = |x: f64| {
            if x.is_infinite() {
                "any".to_owned()
            } else if x == 0.0 || (1.0..1e7).contains(&x) {
                format!("{x:.0}")
            } else {
                format!("{x:.1e}")
            }
        };
        println!(
            "| {what} | {among} | {} | {} |",
            short(figure),
            short(allowed)
        );
        if figure > allowed || figure.is_nan() {
            self.broken
                .push(format!("{what}: {figure:e} is above {allowed:e}"));
        }
    }

    /// How far the run has come, apart from the table.
    pub fn progress(&self, what: &str) {
        eprintln!("{:6.1} s: {what}", self.began.elapsed().as_secs_f64());
    }

    pub fn end(self) {
        assert!(self.broken.is_empty(), "{:#?}", self.broken);
    }
}
