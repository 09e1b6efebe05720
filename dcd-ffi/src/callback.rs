//! Tracks whether this thread is within a function of the user's that the library has called. Then it may hold locks of the
//! library.

use std::cell::Cell;

use crate::status::{DCD_ERR_BUSY, Failure};

/// Function of the user's that the library calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Callback {
    Log,
    Drawing,
    Hook,
    Query,
    Tasks,
    Bug,
}

thread_local! {
    static INSIDE: Cell<Option<Callback>> = const { Cell::new(None) };
}

/// Calls a function of the user's.
pub(crate) fn enter(callback: Callback, call: impl FnOnce()) {
    let outer = INSIDE.replace(Some(callback));
    call();
    INSIDE.set(outer);
}

/// Returns which function of the user's this thread is in now, if any.
pub(crate) fn inside() -> Option<Callback> {
    INSIDE.try_with(Cell::get).unwrap_or(None)
}

/// Fails when this thread is within a function of the user's.
pub(crate) fn check_outside() -> Result<(), Failure> {
    inside().map_or(Ok(()), |callback| Err(busy(callback)))
}

#[cold]
fn busy(callback: Callback) -> Failure {
    let name = match callback {
        Callback::Log => "the log callback",
        Callback::Drawing => "a callback of dcd_debug_draw",
        Callback::Hook => "a function of dcd_hooks_set",
        Callback::Query => "a function that a query calls",
        Callback::Bug => "the function of dcd_bug_set",
        Callback::Tasks => "a function of dcd_tasks_set",
    };
    Failure::new(DCD_ERR_BUSY, format!("called from within {name}; note it there and call later"))
}
