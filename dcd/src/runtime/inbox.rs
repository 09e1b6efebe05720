//! Holds what a process's loop has still to take in: events of the network, inputs of the user, and wakes.
//!
//! The network's thread puts events here itself, so that no further thread is woken for them. Events do not
//! wait for room: each peer's share bounds what it may have here. A user's inputs are bounded in number; a
//! user who gives more waits.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::ProcessError;

/// The most inputs of the user that wait.
pub(super) const INPUTS: usize = 4_096;

/// The end from which the loop takes entries.
pub(super) struct Inbox<T> {
    entries: mpsc::Receiver<Entry<T>>,
    state: Arc<State>,
}

/// An end into which other threads put entries.
pub(super) struct InboxSender<T> {
    entries: mpsc::Sender<Entry<T>>,
    state: Arc<State>,
}

enum Entry<T> {
    Event(T),
    Input(T),
    Wake(T),
}

#[derive(Default)]
struct State {
    /// The number of inputs that wait; `None` once the loop has ended.
    inputs: Mutex<Option<usize>>,
    taken: Condvar,
    /// Says whether a wake waits.
    is_woken: AtomicBool,
}

/// Makes an inbox.
pub(super) fn inbox<T>() -> (InboxSender<T>, Inbox<T>) {
    let (sender, receiver) = mpsc::channel();
    let state = Arc::new(State { inputs: Mutex::new(Some(0)), ..State::default() });
    (InboxSender { entries: sender, state: state.clone() }, Inbox { entries: receiver, state })
}

impl<T> InboxSender<T> {
    /// Adds an input of the user, once there is room for one.
    pub(super) fn send(&self, input: T) -> Result<(), ProcessError> {
        let inputs = self.state.inputs.lock().unwrap_or_else(PoisonError::into_inner);
        let is_full = |inputs: &mut Option<usize>| inputs.is_some_and(|inputs| inputs >= INPUTS);
        let mut inputs = self.state.taken.wait_while(inputs, is_full).unwrap_or_else(PoisonError::into_inner);
        *inputs.as_mut().ok_or(ProcessError::Stopped)? += 1;
        self.entries.send(Entry::Input(input)).map_err(|_| ProcessError::Stopped)
    }

    /// Adds an event, without waiting. Returns whether the loop still takes entries.
    pub(super) fn tell(&self, event: T) -> bool {
        self.entries.send(Entry::Event(event)).is_ok()
    }

    /// Wakes the loop, unless it is woken already.
    pub(super) fn wake(&self, wake: T) {
        if !self.state.is_woken.swap(true, Ordering::AcqRel) {
            let _ = self.entries.send(Entry::Wake(wake));
        }
    }
}

// Implemented by hand: a derived one would require that `T` can be cloned.
impl<T> Clone for InboxSender<T> {
    fn clone(&self) -> Self {
        Self { entries: self.entries.clone(), state: self.state.clone() }
    }
}

impl<T> Inbox<T> {
    /// Waits for the next entry, no longer than `timeout`.
    pub(super) fn recv_timeout(&self, timeout: Duration) -> Result<T, RecvTimeoutError> {
        self.entries.recv_timeout(timeout).map(|entry| self.opened(entry))
    }

    /// Returns the entries that are there, without waiting.
    pub(super) fn try_iter(&self) -> impl Iterator<Item = T> + '_ {
        self.entries.try_iter().map(|entry| self.opened(entry))
    }

    fn opened(&self, entry: Entry<T>) -> T {
        match entry {
            Entry::Event(event) => event,
            Entry::Input(input) => {
                let mut inputs = self.state.inputs.lock().unwrap_or_else(PoisonError::into_inner);
                *inputs = inputs.map(|inputs| inputs.saturating_sub(1));
                self.state.taken.notify_one();
                input
            }
            Entry::Wake(wake) => {
                // Cleared before the loop looks at its work: work that comes meanwhile wakes it again.
                self.state.is_woken.store(false, Ordering::Release);
                wake
            }
        }
    }
}

impl<T> Drop for Inbox<T> {
    fn drop(&mut self) {
        *self.state.inputs.lock().unwrap_or_else(PoisonError::into_inner) = None;
        self.state.taken.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_gives_too_many_inputs_waits_until_one_is_taken_or_the_loop_has_ended() {
        let (sender, inbox) = inbox();
        (0..INPUTS).for_each(|i| sender.send(i).unwrap());
        let (told, tells) = mpsc::channel();
        let giver = sender.clone();
        let thread = std::thread::spawn(move || {
            for input in [INPUTS, INPUTS + 1] {
                told.send(giver.send(input).is_ok()).unwrap();
            }
        });
        let none = tells.recv_timeout(Duration::from_millis(50));
        assert!(none.is_err(), "there is no room");
        // An event needs no room.
        assert!(sender.tell(7));
        assert_eq!(inbox.try_iter().next(), Some(0));
        assert_eq!(tells.recv(), Ok(true));
        drop(inbox);
        assert_eq!(tells.recv(), Ok(false));
        thread.join().unwrap();
        assert!(!sender.tell(8) && sender.send(9).is_err());
    }

    #[test]
    fn a_loop_is_woken_once_until_it_takes_that_and_takes_all_in_order() {
        let (sender, inbox) = inbox();
        for round in 0..2 {
            sender.tell(1);
            sender.wake(2);
            sender.wake(3);
            sender.send(4).unwrap();
            assert_eq!(inbox.try_iter().collect::<Vec<_>>(), [1, 2, 4], "round {round}");
        }
        assert!(matches!(inbox.recv_timeout(Duration::ZERO), Err(RecvTimeoutError::Timeout)));
    }
}
