//! The library itself: version, errors, log.

use std::ffi::{c_char, c_void};

use crate::guard::{guard, guard_value};
use crate::log;
use crate::status::{self, DcdStatus};

/// Most items of one bulk call.
pub const DCD_MAX_ITEMS: usize = 16_777_216;

/// Every number given as a float lies within plus and minus this, where its function does not say otherwise: what is beyond
/// would not stay finite in single precision.
pub const DCD_MAX_NUMBER: f32 = 1.0e6;
/// Every coordinate in world space lies within plus and minus this, metres.
pub const DCD_MAX_COORDINATE: f64 = 1.0e9;

/// How grave a log line is; DCD_LOG_OFF to DCD_LOG_TRACE.
pub type DcdLogLevel = u32;

/// Nothing.
pub const DCD_LOG_OFF: DcdLogLevel = 0;
/// Something failed.
pub const DCD_LOG_ERROR: DcdLogLevel = 1;
/// Something is not as it should be.
pub const DCD_LOG_WARN: DcdLogLevel = 2;
/// What happened at large.
pub const DCD_LOG_INFO: DcdLogLevel = 3;
/// What happened in detail; every failed call.
pub const DCD_LOG_DEBUG: DcdLogLevel = 4;
/// Everything.
pub const DCD_LOG_TRACE: DcdLogLevel = 5;

/// Receives log lines: `user` as given, the level, `length` bytes of UTF-8 that end without NUL and are valid during the
/// call. Any thread may call it, several at a time. It must return normally (no longjmp, no C++ exception), and calls on
/// worlds from within it give DCD_ERR_BUSY.
pub type DcdLogFn = Option<
    unsafe extern "C" fn(user: *mut c_void, level: DcdLogLevel, message: *const c_char, length: usize),
>;

/// The version of the library that runs: major * 1000000 + minor * 1000 + patch. The header's own is DCD_VERSION;
/// dcd_version_check() compares them.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_version() -> u32 {
    const fn number(text: &str) -> u32 {
        match u32::from_str_radix(text, 10) {
            Ok(number) => number,
            Err(_) => panic!("a package's version is made of numbers"),
        }
    }
    const VERSION: u32 = number(env!("CARGO_PKG_VERSION_MAJOR")) * 1_000_000
        + number(env!("CARGO_PKG_VERSION_MINOR")) * 1000
        + number(env!("CARGO_PKG_VERSION_PATCH"));
    VERSION
}

/// The same as text, as "0.1.0". Lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_version_string() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// The name of a status, as "DCD_ERR_NULL"; "(no DCD status)" for other numbers. Lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_status_string(status: DcdStatus) -> *const c_char {
    status::name(status).as_ptr()
}

/// Copies the message of the calling thread's last failed call: the function, the cause, the remedy. At most `cap` bytes
/// are written, NUL included; a longer message is cut. Calls that succeed leave the message as it is.
///
/// Returns the length of the whole message without NUL, 0 if no call failed yet. `buf` may be null to ask for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_last_error(buf: *mut c_char, cap: usize) -> usize {
    // SAFETY: the caller vouches for `cap` bytes at `buf`.
    guard_value(0, || unsafe { status::copy_text(&status::last(), buf, cap) })
}

/// Sends log lines up to the level `most` to `function`, with `user` as its first argument; a null function turns the log
/// off. When this returns, the former function is not running and will not be called again.
///
/// One function serves the whole process. Errors: DCD_ERR_ARGUMENT for an unknown level, DCD_ERR_BUSY from within the
/// callback.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_log_set(function: DcdLogFn, user: *mut c_void, most: DcdLogLevel) -> DcdStatus {
    guard("dcd_log_set", || log::set(function, user, most))
}
