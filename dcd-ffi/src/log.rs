//! Forwards the log lines of dcd to one C function.

use std::ffi::{c_char, c_void};
use std::fmt::{self, Write};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{OnceLock, PoisonError, RwLock};

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

use crate::callback::{Callback, check_outside, enter, inside};
use crate::guard::guard;
use crate::status::{DCD_ERR_UNSUPPORTED, DcdStatus, Failure};

/// Severity of a log line: DCD_LOG_OFF to DCD_LOG_TRACE.
pub type DcdLogLevel = u32;

/// Logs nothing.
pub const DCD_LOG_OFF: DcdLogLevel = 0;
/// Logs failures: something failed.
pub const DCD_LOG_ERROR: DcdLogLevel = 1;
/// Logs warnings: something is not as it should be.
pub const DCD_LOG_WARN: DcdLogLevel = 2;
/// Logs milestones: processes that join and leave, views, failures of nodes.
pub const DCD_LOG_INFO: DcdLogLevel = 3;
/// Logs every step of joins and view changes, and every failed call.
pub const DCD_LOG_DEBUG: DcdLogLevel = 4;
/// Logs everything.
pub const DCD_LOG_TRACE: DcdLogLevel = 5;

/// Receives a log line. `user` is the pointer given to dcd_log_set. `message` has `length` bytes of UTF-8 without a NUL at the end,
/// valid during the call.
///
/// Any thread may call the function, several threads at a time. It must return normally (no longjmp, no C++ exception). Calls on
/// worlds from within it give DCD_ERR_BUSY.
pub type DcdLogFn = Option<
    unsafe extern "C" fn(user: *mut c_void, level: DcdLogLevel, message: *const c_char, length: usize),
>;

/// Sends log lines up to the level `most` to `function`, with `user` as its first argument. A null function turns the log off. When
/// this call returns, the former function is not running and will not be called again.
///
/// One function serves the whole process.
/// Errors: DCD_ERR_ARGUMENT (an unknown level), DCD_ERR_BUSY (called from within the function).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_log_set(function: DcdLogFn, user: *mut c_void, most: DcdLogLevel) -> DcdStatus {
    guard("dcd_log_set", || set(function, user, most))
}

/// The user's function, and the pointer it is called with.
struct Sink {
    function: unsafe extern "C" fn(*mut c_void, DcdLogLevel, *const c_char, usize),
    user: *mut c_void,
}

// SAFETY: the header asks for a function that any thread may call with this pointer.
unsafe impl Send for Sink {}
// SAFETY: as above.
unsafe impl Sync for Sink {}

static SINK: RwLock<Option<Sink>> = RwLock::new(None);
static MOST: AtomicU32 = AtomicU32::new(DCD_LOG_OFF);

/// Replaces the user's function. When this returns, the former function is not running and will not be called again.
pub(crate) fn set(function: DcdLogFn, user: *mut c_void, most: DcdLogLevel) -> Result<(), Failure> {
    check_outside()?;
    if most > DCD_LOG_TRACE {
        return Err(Failure::argument(format!("level {most} is none; use DCD_LOG_OFF to DCD_LOG_TRACE")));
    }
    static INSTALLED: OnceLock<bool> = OnceLock::new();
    if !INSTALLED.get_or_init(|| tracing::subscriber::set_global_default(Forward).is_ok()) {
        return Err(Failure::new(
            DCD_ERR_UNSUPPORTED,
            "this program's Rust part has a tracing subscriber of its own; read dcd's log there",
        ));
    }
    let mut sink = SINK.write().unwrap_or_else(PoisonError::into_inner);
    *sink = function.map(|function| Sink { function, user });
    MOST.store(if sink.is_some() { most } else { DCD_LOG_OFF }, Ordering::Relaxed);
    Ok(())
}

/// Formats events and hands them to the user's function. Spans carry nothing that an event of dcd does not say itself.
struct Forward;

impl Subscriber for Forward {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> tracing::subscriber::Interest {
        tracing::subscriber::Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_event()
            && level(metadata.level()) <= MOST.load(Ordering::Relaxed)
            && inside() != Some(Callback::Log)
    }

    fn event(&self, event: &Event<'_>) {
        let mut line = Line::default();
        event.record(&mut line);
        let text = line.message + &line.fields;
        let sink = SINK.read().unwrap_or_else(PoisonError::into_inner);
        let Some(sink) = &*sink else { return };
        let level = level(event.metadata().level());
        // SAFETY: the user's function, called as the header says; the text outlives the call.
        enter(Callback::Log, || unsafe {
            (sink.function)(sink.user, level, text.as_ptr().cast(), text.len());
        });
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

fn level(level: &Level) -> DcdLogLevel {
    match *level {
        Level::ERROR => DCD_LOG_ERROR,
        Level::WARN => DCD_LOG_WARN,
        Level::INFO => DCD_LOG_INFO,
        Level::DEBUG => DCD_LOG_DEBUG,
        Level::TRACE => DCD_LOG_TRACE,
    }
}

#[derive(Default)]
struct Line {
    message: String,
    fields: String,
}

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a string cannot fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
}
