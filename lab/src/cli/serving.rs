//! Common options of the two servers: address, end, output.

use std::sync::{Arc, atomic::Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use vines::ArgumentError;
use vines::helic::{Device, HelicServer};
use vines::net::{Address, LinkError, Served, Server, ServerError, Service, Session, resolve};

use super::endpoint::{ReachArguments, no_key};
use super::{failure::Failure, interrupt::stop_flag, output::print};

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
    #[arg(long, value_name = "N", value_parser = count::<u64>)]
    sessions: Option<u64>,

    /// Print a line of JSON per session instead of text
    #[arg(long)]
    pub(super) json: bool,
}

impl ServingArguments {
    /// Serves `what` at a TCP or UDP address: prints the address, then a report per session, which `keep` gets, too.
    pub(super) fn serve(
        &self,
        what: &str,
        transport: fn(std::net::SocketAddr) -> Address,
        service: Service,
        make: impl FnMut() -> Result<Served, ServerError>,
        keep: impl Fn(&Session),
    ) -> Result<String, Failure> {
        let scope = self.reach.reach()?;
        let mut server = Server::listen(transport(resolve(&self.listen, scope)?), service, scope.key())?;
        let address = server.address().map_err(Failure::run)?;
        self.run(&format!("{what} on {address}"), keep, |stop, tell| {
            server.serve(make, stop, tell)
        })
    }

    /// Serves `device` as a device of helic-daq, sampled every `sample_time`, s.
    pub(super) fn serve_helic(
        &self,
        device: Device,
        sample_time: f64,
        keep: impl Fn(&Session),
    ) -> Result<String, Failure> {
        let scope = self.reach.reach()?;
        no_key(scope)?;
        let address = resolve(&self.listen, scope)?;
        let listen = |source| LinkError::Listen { address: Address::Tcp(address), source };
        let mut server = HelicServer::listen(address, device, sample_time).map_err(listen)?;
        let what = format!("helic device, {:.1} samples per second, on", 1.0 / sample_time);
        let address = server.address().map_err(Failure::run)?;
        self.run(&format!("{what} helic://{address}"), keep, |stop, tell| {
            server.serve(stop, tell)
        })
    }

    /// Runs a server: prints `what`, then a report per session.
    fn run(
        &self,
        what: &str,
        keep: impl Fn(&Session),
        serve: impl FnOnce(&mut dyn FnMut() -> bool, &mut dyn FnMut(&Session)) -> Result<(), ServerError>,
    ) -> Result<String, Failure> {
        let stop = stop_flag()?;
        print(&format!("{what}\n"))?;
        let enough = Arc::clone(&stop);
        let end = self
            .duration
            .map(|seconds| Instant::now() + Duration::from_secs_f64(seconds));
        let mut stop = move || stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end);
        let (json, sessions, mut served) = (self.json, self.sessions, 0);
        let mut tell = move |session: &Session| {
            let text = if json {
                serde_json::to_string(session).map_or_else(|e| e.to_string(), |line| line + "\n")
            } else {
                session.to_string()
            };
            keep(session);
            // A closed output does not stop the server.
            let _ = print(&text);
            served += 1;
            if sessions == Some(served) {
                enough.store(true, Ordering::Relaxed);
            }
        };
        serve(&mut stop, &mut tell).map_err(Failure::run)?;
        Ok(String::new())
    }
}

/// A number above 0 and at most 1e8, for seconds and metres.
pub(super) fn positive(text: &str) -> Result<f64, ArgumentError> {
    let value: f64 = text.parse().map_err(|_| "expected a number")?;
    if value > 0.0 && value <= 1e8 {
        Ok(value)
    } else {
        Err("must be above 0 and at most 1e8".into())
    }
}

/// A number of runs, seeds or the like.
pub(super) fn count<T: TryFrom<u64>>(text: &str) -> Result<T, ArgumentError> {
    let value = text.parse().ok().filter(|count| (1..=1_000_000_000).contains(count));
    let value = value.and_then(|count: u64| count.try_into().ok());
    value.ok_or_else(|| "expected a whole number from 1 to 1000000000".into())
}
