//! The table: what was asked for, what came of it, what is allowed.

use std::time::Instant;

#[derive(Debug)]
pub struct Table {
    broken: Vec<String>,
    others: Vec<String>,
    began: Instant,
}

impl Table {
    pub fn begin() -> Self {
        println!("| what | among | figure | allowed |\n|---|---|---|---|");
        Self {
            broken: Vec::new(),
            others: Vec::new(),
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
        println!("| {what} | {among} | {} | {} |", short(figure), short(allowed));
        if figure > allowed || figure.is_nan() {
            self.broken.push(format!("{what}: {figure:e} is above {allowed:e}"));
        }
    }

    /// A table of its own, printed after this one.
    pub fn second(&mut self, title: &str, head: &str, lines: &[String]) {
        let columns = head.matches('|').count() - 1;
        let rule = format!("|{}", "---|".repeat(columns));
        self.others
            .push(format!("\n{title}\n\n{head}\n{rule}\n{}", lines.join("\n")));
    }

    /// How far the run has come, apart from the table.
    pub fn progress(&self, what: &str) {
        eprintln!("{:6.1} s: {what}", self.began.elapsed().as_secs_f64());
    }

    pub fn end(self) {
        for other in &self.others {
            println!("{other}");
        }
        assert!(self.broken.is_empty(), "{:#?}", self.broken);
    }
}
