//! Runs the body of every entry point: turns failures and panics into a status and a message.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::status::{DCD_ERR_PANIC, DCD_OK, DcdStatus, Failure, remember};

/// Runs the body of an entry point. A failure becomes its status and the thread's last error, a panic DCD_ERR_PANIC.
///
/// Unwind safety: state that a panic could leave half changed lies in a world, whose lock the panic poisons.
pub(crate) fn guard(function: &'static str, body: impl FnOnce() -> Result<(), Failure>) -> DcdStatus {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => DCD_OK,
        Ok(Err(failure)) => fail(function, failure),
        Err(payload) => fail(function, panicked(payload)),
    }
}

#[cold]
fn fail(function: &'static str, failure: Failure) -> DcdStatus {
    remember(function, &failure);
    tracing::debug!(status = failure.status, "{function}: {}", failure.message);
    failure.status
}

#[cold]
fn panicked(payload: Box<dyn Any + Send>) -> Failure {
    let message = panic_message(&*payload);
    Failure::new(DCD_ERR_PANIC, format!("a bug in dcd ({message}); destroy the world, and report this"))
}

/// Runs the body of one of the few functions that return something else. `fallback` stands for failure.
pub(crate) fn guard_value<R>(fallback: R, body: impl FnOnce() -> R) -> R {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or(fallback)
}

pub(crate) fn panic_message(payload: &(dyn Any + Send)) -> &str {
    match (payload.downcast_ref::<&str>(), payload.downcast_ref::<String>()) {
        (Some(text), _) => text,
        (None, Some(text)) => text,
        (None, None) => "a panic without a message",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::{DCD_ERR_ARGUMENT, last};

    #[test]
    fn a_panic_becomes_a_status_with_its_message() {
        let status = guard("dcd_test", || panic!("number {}", 7));
        assert_eq!(status, DCD_ERR_PANIC);
        assert!(last().contains("number 7"), "{}", last());
    }

    #[test]
    fn a_failure_names_the_function_and_success_keeps_the_last_message() {
        assert_eq!(guard("dcd_test", || Err(Failure::argument("too long; cut it"))), DCD_ERR_ARGUMENT);
        assert_eq!(guard("dcd_other", || Ok(())), DCD_OK);
        assert_eq!(last(), "dcd_test: too long; cut it");
    }
}
