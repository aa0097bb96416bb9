//! What the two servers share: where they listen, when they end, what they print.

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

use super::{door::ReachArguments, failure::Failure, print};

#[derive(Debug, Args)]
pub(super) struct ServingArguments {
    /// Where to listen, such as 127.0.0.1:5510; port 0 takes a free one, which is printed
    #[arg(long, value_name = "HOST:PORT")]
    listen: String,

    #[command(flatten)]
    reach: ReachArguments,

    /// End after this long, s; without it, on Ctrl-C
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

    /// Says where the server listens, and returns when it shall stop and what it does with a session's report.
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
        let stop =
            move || stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end);
        let (json, sessions, mut served) = (self.json, self.sessions, 0);
        let tell = move |session: &Session| {
            let text = if json {
                serde_json::to_string(session).map_or_else(|e| e.to_string(), |line| line + "\n")
            } else {
                session.to_string()
            };
            // A reader who has gone does not end the service.
            let _ = print(&text);
            served += 1;
            if sessions == Some(served) {
                enough.store(true, Ordering::Relaxed);
            }
        };
        Ok((stop, tell))
    }
}

/// A number above 0 and at most 1e8: seconds up to some years, or metres.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number is wanted")?;
    if value > 0.0 && value <= 1e8 {
        Ok(value)
    } else {
        Err("must be above 0 and at most 1e8".into())
    }
}
