//! Holds a world in etcd for one server at a time: waits until nobody else does, and renews the hold by a thread of its own.
//!
//! The holder writes its key three times per [`TENURE`]. Who stands by takes over when it has seen that key unchanged for
//! [`PATIENCE`] by its own clock: it removes the key if it is still as it was, and creates its own where there is none. So clocks need
//! not agree, only run alike; Kubernetes elects its leaders so too (client-go, `leaderelection`). etcd's own leases are not used:
//! they last two seconds at least, are looked after twice a second, and all begin anew when etcd elects a leader.
//!
//! Each transaction compares the revision at which the holder's key was created: one that was deposed and does not know it yet
//! writes nothing any more, however long it was stopped.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::gateway::{Compare, GatewayError, Op};
use super::keys::{Hold, Keys};
use crate::cluster::directory::DirectoryError;

/// How long the holder is the only one, from the moment at which it began to ask.
const TENURE: Duration = Duration::from_millis(1_000);
/// How long who stands by waits for a sign of the holder, from the moment at which it has seen the last one. What it is longer than
/// [`TENURE`] is for clocks that run unlike, and for what the holder is just doing.
const PATIENCE: Duration = Duration::from_millis(1_500);
/// How often who stands by looks.
const LOOK: Duration = Duration::from_millis(50);
/// Who has not seen anything for so long, because it was stopped or etcd was away, begins to wait anew: perhaps the holder could
/// not write either.
const BLIND: Duration = Duration::from_millis(750);

/// Waits until nobody holds these keys, and holds them. `holder` says who asks, unlike all others. While another one has them, `goes_on`
/// is told who, again and again, and says whether to wait on; if not, `None` is returned.
pub(super) fn hold(
    mut keys: Keys,
    holder: &str,
    goes_on: &mut dyn FnMut(&str) -> bool,
) -> Result<Option<Hold>, DirectoryError> {
    let key = keys.holder();
    let (mut vigil, mut reached) = (Vigil::default(), false);
    loop {
        let found = keys.gateway.read(&key);
        reached |= found.is_ok();
        match found {
            Ok(None) => {
                let create = Op::Put(key.clone(), holder.as_bytes().to_vec());
                // Whose it is then is seen by reading it.
                let created = keys.gateway.transact(&[Compare::Created(key.clone(), 0)], &[create]);
                if let Err(GatewayError::Away(cause) | GatewayError::Refused(cause)) = created {
                    if !goes_on(&format!("nobody, but etcd takes no writes: {cause}")) {
                        return Ok(None);
                    }
                    std::thread::sleep(LOOK);
                }
            }
            Ok(Some(found)) if found.value == holder.as_bytes() => {
                return Ok(Some(Hold::new(keys, holder.to_owned(), found.created)));
            }
            Ok(Some(found)) if vigil.is_over(Instant::now(), found.written) => {
                let unchanged = Compare::Written(key.clone(), found.written);
                let _ = keys.gateway.transact(&[unchanged], &[Op::delete(&key)]);
            }
            Ok(Some(found)) => {
                if !goes_on(&String::from_utf8_lossy(&found.value)) {
                    return Ok(None);
                }
                std::thread::sleep(LOOK);
            }
            // Who has never reached it has a wrong address.
            Err(GatewayError::Away(cause)) if reached => {
                if !goes_on(&format!("nobody knows whom: {cause}")) {
                    return Ok(None);
                }
                std::thread::sleep(LOOK);
            }
            Err(error) => return Err(keys.unreadable(&error)),
        }
    }
}

/// What who stands by has seen of the holder.
#[derive(Default)]
struct Vigil {
    /// When the holder's key was last written, and since when that is known.
    sign: Option<(i64, Instant)>,
    looked: Option<Instant>,
}

impl Vigil {
    /// Takes in that the key was last written at this revision of etcd; returns whether the holder has been silent for too long.
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

/// How long the holder says nothing after its hold has run out, before it gives up: an election of etcd takes less. Its nodes and clients
/// hold on to it for as long as it lives, whoever has taken over.
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
    /// Nothing is said to etcd any more.
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

    /// Returns how long the hold lasts, at least. Waits while it has run out and is not yet known to be lost, as after a stop of
    /// the process or within an election of etcd, but not for long.
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
    /// Stops to renew the hold without letting go, as a process that is killed or stopped.
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
    use super::*;

    /// Looks as often as who stands by does, and returns after how long it takes over.
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
        // Stopped for a minute.
        let over = over_after(&mut vigil, start, 60_000 - 20_000, |_| Some(1));
        assert_eq!(over, 41_500);
        // etcd elects a leader from 1 s to 3 s.
        let over =
            over_after(&mut Vigil::default(), start, 0, |ms| (!(1_000..3_000).contains(&ms)).then_some(1));
        assert_eq!(over, 4_500);
    }
}
