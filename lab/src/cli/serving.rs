//! Common options of the two servers: address, end, output.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use clap::Args;
use vines::net::{Session, resolve};

use super::{endpoint::ReachArguments, failure::Failure, print};

#[derive(Debug, Args)]
pub(super) struct ServingArguments {
    /// Address of the server, such as 127.0.0.1:5510; with port 0 the system chooses a free port
    #[arg(long, value_name = "HOST:PORT")]
    listen: String,

    #[command(flatten)]
    reach: ReachArguments,

    /// End after this time, s [default: at Ctrl-C]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    duration: Option<f64>,

    /// End after this many sessions
    #[arg(long, value_name = "N")]
    sessions: Option<u64>,

    /// Print a line of JSON per session instead of text
    #[arg(long)]
    json: bool,
}

impl ServingArguments {
    pub(super) fn address(&self) -> Result<SocketAddr, Failure> {
        Ok(resolve(&self.listen, self.reach.reach())?)
    }

    /// Prints the address. Returns a function that is true when the server should stop, and one that prints reports.
    pub(super) fn begin(
        &self,
        what: &str,
        address: SocketAddr,
    ) -> Result<(impl Fn() -> bool, impl FnMut(&Session)), Failure> {
        let stop = Arc::new(AtomicBool::new(false));
        let signal = Arc::clone(&stop);
        ctrlc::set_handler(move || signal.store(true, Ordering::Relaxed))
            .map_err(|error| Failure::run(format!("cannot wait for Ctrl-C: {error}")))?;
        print(&format!("{what} on udp://{address}\n"))?;
        let enough = Arc::clone(&stop);
        let end = self
            .duration
            .map(|seconds| Instant::now() + Duration::from_secs_f64(seconds));
        let stop = move || stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end);
        let (json, sessions, mut served) = (self.json, self.sessions, 0);
        let tell = move |session: &Session| {
            let text = if json {
                serde_json::to_string(session).map_or_else(|e| e.to_string(), |line| line + "\n")
            } else {
                session.to_string()
            };
            // A closed output does not stop the server.
            let _ = print(&text);
            served += 1;
            if sessions == Some(served) {
                enough.store(true, Ordering::Relaxed);
            }
        };
        Ok((stop, tell))
    }
}

/// A number above 0 and at most 1e8, for seconds and metres.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected is a number")?;
    if value > 0.0 && value <= 1e8 {
        Ok(value)
    } else {
        Err("must be above 0 and at most 1e8".into())
    }
}
