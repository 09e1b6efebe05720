//! Dials all addresses at which one peer may be, and takes the one that answers first.

use std::future::Future;
use std::net::SocketAddr;
use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::{Instant, interval_at, sleep_until};

use super::NetError;

/// The interval at which a peer that may be at several addresses is dialled anew. QUIC repeats its first
/// packets ever more slowly, but a server that takes over must be found at once.
pub(super) const AGAIN: Duration = Duration::from_millis(500);

/// Tries all addresses at once and returns the first success. With several addresses, all are tried again per
/// [`AGAIN`] until one succeeds: a server that refuses may be about to stop, and another one to take over.
pub(super) async fn first_of<T, F>(
    addrs: &[SocketAddr],
    timeout: Duration,
    trial: impl Fn(SocketAddr) -> F,
) -> Result<T, NetError>
where
    T: Send + 'static,
    F: Future<Output = Result<T, NetError>> + Send + 'static,
{
    let begun = Instant::now();
    let mut again = interval_at(begun + AGAIN, AGAIN);
    let mut trials = JoinSet::new();
    let begin = |trials: &mut JoinSet<_>| addrs.iter().for_each(|&addr| drop(trials.spawn(trial(addr))));
    begin(&mut trials);
    let mut failed = None;
    loop {
        tokio::select! {
            Some(ended) = trials.join_next() => match ended {
                Ok(Ok(found)) => return Ok(found),
                Ok(Err(error)) if addrs.len() < 2 => return Err(more_telling(failed, error)),
                Ok(Err(error)) => failed = Some(more_telling(failed, error)),
                Err(panic) => std::panic::resume_unwind(panic.into_panic()),
            },
            _ = again.tick(), if addrs.len() > 1 => begin(&mut trials),
            () = sleep_until(begun + timeout) => {
                let unreachable = |addr| NetError::Unreachable { addr, waited: timeout };
                return Err(failed.unwrap_or_else(|| unreachable(addrs[0])));
            }
        }
    }
}

/// Returns the more telling of two errors. That nobody answers at one of several addresses tells nothing.
fn more_telling(former: Option<NetError>, error: NetError) -> NetError {
    match (former, error) {
        (Some(former), NetError::Unreachable { .. }) => former,
        (_, error) => error,
    }
}
