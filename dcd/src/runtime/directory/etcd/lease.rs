//! Holds a world in etcd for one server at a time: waits until no other server holds it, and renews the hold
//! on a thread of its own.
//!
//! The holder writes its key three times per [`TENURE`]. A standby server takes over when it has seen that
//! key unchanged for [`PATIENCE`] by its own clock: it removes the key if it is still as it was, and creates
//! its own if there is none. So clocks need not agree, but only run at the same rate. Kubernetes elects its
//! leaders in the same way (client-go, `leaderelection`). etcd's own leases are not used: they last two
//! seconds at least, are checked twice a second, and all begin anew when etcd elects a leader.
//!
//! Each transaction compares the revision at which the holder's key was created. So a holder that was deposed
//! and does not know it yet cannot write any more, however long it was stopped.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::gateway::{Compare, GatewayError, Op};
use super::keys::{Hold, Keys};
use crate::cluster::directory::DirectoryError;

/// How long a hold is exclusive, counted from when its renewal was requested.
const TENURE: Duration = Duration::from_millis(1_000);
/// How long a standby server waits for a sign of the holder after the last one that it has seen. The margin
/// over [`TENURE`] covers clocks that run at different rates, and what the holder is just doing.
const PATIENCE: Duration = Duration::from_millis(1_500);
/// How often a standby server looks.
const LOOK: Duration = Duration::from_millis(50);
/// A standby server that has seen nothing for this long, because it was stopped or etcd was away, begins to
/// wait anew: perhaps the holder could not write either.
const BLIND: Duration = Duration::from_millis(750);

/// The reason why a world is not held yet, for people to read.
pub(in crate::runtime::directory) enum Wait {
    /// Another server holds the world.
    Held(String),
    /// etcd does not do what it is asked, as during an election or on a slow disk.
    Away(String),
}

/// Waits until nobody holds these keys, and holds them. `holder` names this server, unlike all others. During
/// the wait `goes_on` is told repeatedly why it waits, and decides whether to keep waiting; if not, this
/// returns `None`.
pub(super) fn hold(
    mut keys: Keys,
    holder: &str,
    goes_on: &mut dyn FnMut(Wait) -> bool,
) -> Result<Option<Hold>, DirectoryError> {
    let key = keys.holder();
    let (mut vigil, mut reached) = (Vigil::default(), false);
    loop {
        let found = keys.gateway.read(&key);
        reached |= found.is_ok();
        let wait = match found {
            Ok(None) => {
                let create = Op::Put(key.clone(), holder.as_bytes().to_vec());
                // Reading the key shows who holds it then.
                match keys.gateway.transact(&[Compare::Created(key.clone(), 0)], &[create]) {
                    Ok(_) => continue,
                    Err(error) => Wait::Away(format!("it takes no writes: {error}")),
                }
            }
            Ok(Some(found)) if found.value == holder.as_bytes() => {
                return Ok(Some(Hold::new(keys, holder.to_owned(), found.created)));
            }
            Ok(Some(found)) if vigil.is_over(Instant::now(), found.written) => {
                let unchanged = Compare::Written(key.clone(), found.written);
                match keys.gateway.transact(&[unchanged], &[Op::delete(&key)]) {
                    Ok(_) => continue,
                    Err(error) => Wait::Away(format!(
                        "it takes no writes, and a server that is gone has its world: {error}"
                    )),
                }
            }
            Ok(Some(found)) => Wait::Held(String::from_utf8_lossy(&found.value).into_owned()),
            // If etcd was never reached, its address is wrong.
            Err(GatewayError::Away(cause)) if reached => Wait::Away(format!("it is out of reach: {cause}")),
            Err(error) => return Err(keys.unreadable(&error)),
        };
        if !goes_on(wait) {
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}

/// What a standby server has seen of the holder.
#[derive(Default)]
struct Vigil {
    /// The revision at which the holder's key was last written, and since when that is known.
    sign: Option<(i64, Instant)>,
    looked: Option<Instant>,
}

impl Vigil {
    /// Takes in that the key was last written at this revision of etcd. Returns whether the holder has been
    /// silent for too long.
    fn is_over(&mut self, now: Instant, written: i64) -> bool {
        let looked = self.looked.replace(now);
        let was_blind = looked.is_some_and(|looked| now.saturating_duration_since(looked) > BLIND);
        match self.sign {
            Some((seen, since)) if seen == written && !was_blind => {
                now.saturating_duration_since(since) >= PATIENCE
            }
            _ => {
                self.sign = Some((written, now));
                false
            }
        }
    }
}

/// How long the holder waits for etcd after its hold has run out, before it gives up: an election of etcd
/// takes less. Its nodes and clients keep to it for as long as it lives, even if another server has taken
/// over.
const RUN_OUT: Duration = Duration::from_millis(2_500);

/// A hold that is renewed until this is dropped.
pub(super) struct Lease {
    place: String,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    until: Instant,
    lost: Option<DirectoryError>,
    is_released: bool,
    /// Nothing is sent to etcd any more.
    #[cfg(test)]
    is_abandoned: bool,
}

impl Lease {
    /// Begins to renew a hold.
    pub(super) fn begin(mut hold: Hold) -> Result<Self, DirectoryError> {
        let state = State {
            until: Instant::now(),
            lost: None,
            is_released: false,
            #[cfg(test)]
            is_abandoned: false,
        };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() });
        let place = hold.keys().place();
        let renewed = shared.clone();
        let thread = std::thread::Builder::new().name("dcd-lease".into()).spawn(move || renewed.renew(hold));
        let thread = thread
            .map_err(|error| DirectoryError::Unreadable { place: place.clone(), cause: error.to_string() })?;
        Ok(Self { place, shared, thread: Some(thread) })
    }

    /// Returns how long the hold lasts at least. If the hold has run out and is not known to be lost, as
    /// after a stop of the process or during an election of etcd, this waits first, but not for long.
    pub(super) fn left(&self) -> Result<Duration, DirectoryError> {
        let state = self.shared.lock();
        let waits = |state: &mut State| state.lost.is_none() && state.until <= Instant::now();
        let waited = self.shared.changed.wait_timeout_while(state, RUN_OUT, waits);
        let (state, waited) = waited.unwrap_or_else(PoisonError::into_inner);
        if waited.timed_out() {
            let cause =
                "etcd has not answered for seconds, and another server may have taken over".to_owned();
            return Err(DirectoryError::Unwritable { place: self.place.clone(), cause });
        }
        match &state.lost {
            Some(error) => Err(error.clone()),
            None => Ok(state.until.saturating_duration_since(Instant::now())),
        }
    }

    fn end(&mut self) {
        self.shared.lock().is_released = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn renew(&self, mut hold: Hold) {
        loop {
            let asked = Instant::now();
            let renewed = hold.renew();
            let mut state = self.lock();
            match renewed {
                Ok(()) => state.until = asked + TENURE,
                Err(error) => state.lost = Some(error),
            }
            self.changed.notify_all();
            if state.lost.is_some() {
                return;
            }
            let waits = |state: &mut State| !state.is_released;
            let (state, _) = self
                .changed
                .wait_timeout_while(state, TENURE / 3, waits)
                .unwrap_or_else(PoisonError::into_inner);
            if state.is_released {
                #[cfg(test)]
                if state.is_abandoned {
                    return;
                }
                drop(state);
                return hold.release();
            }
        }
    }
}

#[cfg(test)]
impl Lease {
    /// Stops renewing the hold without releasing it, like a process that is killed or stopped.
    pub(super) fn abandon(&mut self) {
        self.shared.lock().is_abandoned = true;
        self.end();
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader, Read, Write};
    use std::net::{SocketAddr, TcpListener};

    use data_encoding::BASE64;
    use serde_json::{Value, json};

    use super::*;
    use crate::runtime::directory::etcd::EtcdAddress;

    /// Answers like etcd's gateway, by what is asked: `range` or `txn`. Ends with the test's process.
    fn stand_in(mut answer: impl FnMut(&str) -> (u16, Value) + Send + 'static) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let mut reader = BufReader::new(stream.unwrap());
                let head: Vec<_> =
                    reader.by_ref().lines().map(Result::unwrap).take_while(|line| !line.is_empty()).collect();
                let length = head.iter().find_map(|line| {
                    let (name, value) = line.split_once(':')?;
                    name.eq_ignore_ascii_case("content-length").then(|| value.trim().parse::<u64>().ok())?
                });
                reader.by_ref().take(length.unwrap_or(0)).read_to_end(&mut Vec::new()).unwrap();
                let what = if head[0].contains("/range ") { "range" } else { "txn" };
                let (status, body) = answer(what);
                let body = body.to_string();
                let length = body.len();
                let _ = write!(
                    reader.into_inner(),
                    "HTTP/1.1 {status} -\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{body}"
                );
            }
        });
        address
    }

    fn keys(address: SocketAddr) -> Keys {
        Keys::new(EtcdAddress::parse(&format!("etcd://{address}/world")).unwrap()).unwrap()
    }

    fn held_by(holder: &str) -> Value {
        let value = BASE64.encode(holder.as_bytes());
        json!({ "kvs": [{ "key": "YQ==", "value": value, "create_revision": "3", "mod_revision": "3" }] })
    }

    #[test]
    fn an_etcd_that_takes_no_writes_for_a_while_is_no_other_server() {
        let mut writes = 0;
        let address = stand_in(move |what| match what {
            "range" if writes < 3 => (200, json!({})),
            "range" => (200, held_by("one")),
            _ => {
                writes += 1;
                if writes < 3 {
                    (503, json!({ "error": "no leader" }))
                } else {
                    (200, json!({ "succeeded": true }))
                }
            }
        });
        let mut waits = 0;
        let hold = hold(keys(address), "one", &mut |wait| {
            waits += 1;
            matches!(wait, Wait::Away(why) if why.starts_with("it takes no writes: ") && why.contains("no leader"))
        });
        assert!(hold.unwrap().is_some());
        assert_eq!(waits, 2);
    }

    #[test]
    fn a_hold_lasts_while_etcd_is_slow() {
        let mut is_held = false;
        let address = stand_in(move |what| match what {
            "range" if is_held => (200, held_by("one")),
            "range" => (200, json!({})),
            _ if !is_held => {
                is_held = true;
                (200, json!({ "succeeded": true }))
            }
            _ => {
                // Longer than one answer may take at first, and shorter than the tenure.
                std::thread::sleep(Duration::from_millis(600));
                (200, json!({ "succeeded": true }))
            }
        });
        let hold = hold(keys(address), "one", &mut |_| true).unwrap().unwrap();
        let mut lease = Lease::begin(hold).unwrap();
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(5) {
            assert_eq!(lease.left().map(|_| ()), Ok(()));
            std::thread::sleep(LOOK);
        }
        lease.abandon();
    }

    #[test]
    fn who_stands_by_asks_whether_to_wait_on_while_a_silent_holder_cannot_be_removed() {
        let mut writes = 0;
        let address = stand_in(move |what| match what {
            "range" if writes < 20 => (200, held_by("one")),
            // Ends the test: etcd is not asked for ever.
            "range" => (400, json!({ "error": "nobody asks whether to wait on" })),
            _ => {
                writes += 1;
                (503, json!({ "error": "no leader" }))
            }
        });
        let hold = hold(keys(address), "two", &mut |wait| match wait {
            Wait::Held(other) => other == "one",
            Wait::Away(why) => !why.contains("no leader"),
        });
        assert!(hold.unwrap().is_none(), "it was not to wait on");
    }

    /// Looks as often as a standby server does, and returns the time at which it takes over.
    fn over_after(
        vigil: &mut Vigil,
        start: Instant,
        from_ms: u64,
        written: impl Fn(u64) -> Option<i64>,
    ) -> u64 {
        let mut ms = from_ms;
        loop {
            if let Some(written) = written(ms)
                && vigil.is_over(start + Duration::from_millis(ms), written)
            {
                return ms;
            }
            ms += 50;
            assert!(ms < 60_000, "it never takes over");
        }
    }

    #[test]
    fn who_stands_by_takes_over_after_the_last_sign_by_its_own_clock() {
        let start = Instant::now();
        // The holder writes at 0, 300, ... 3000 ms.
        let over = over_after(&mut Vigil::default(), start, 0, |ms| Some((ms.min(3_000) / 300) as i64));
        assert_eq!(over, 4_500);
    }

    #[test]
    fn who_was_stopped_or_did_not_reach_etcd_waits_anew() {
        let start = Instant::now();
        let mut vigil = Vigil::default();
        assert!(!vigil.is_over(start, 1));
        // The standby server is stopped for 40 s.
        let over = over_after(&mut vigil, start, 60_000 - 20_000, |_| Some(1));
        assert_eq!(over, 41_500);
        // etcd elects a leader from 1 s to 3 s.
        let over =
            over_after(&mut Vigil::default(), start, 0, |ms| (!(1_000..3_000).contains(&ms)).then_some(1));
        assert_eq!(over, 4_500);
    }
}
