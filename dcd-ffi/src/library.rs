//! Reports the version of the library, the names of its codes, and the last error.

use std::ffi::c_char;

use crate::event::refused_name;
use crate::guard::guard_value;
use crate::status::{self, DcdStatus};

/// Returns the version of the running library as major * 1000000 + minor * 1000 + patch. DCD_VERSION is the version of the header;
/// dcd_version_check() compares the two.
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

/// Returns the version of the running library as text, such as "0.1.0". The text lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_version_string() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Returns the name of a status, such as "DCD_ERR_NULL", or "(no DCD status)" for other numbers. The text lives as long as the
/// program.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_status_string(status: DcdStatus) -> *const c_char {
    status::name(status).as_ptr()
}

/// Returns the name of a reason for a refusal (DcdBodyChange.reason), such as "DCD_REFUSED_TOO_FAR", or "(no DCD reason)" for other
/// numbers. The text lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_refused_string(reason: u32) -> *const c_char {
    refused_name(reason).as_ptr()
}

/// Copies the message of the calling thread's last failed call: the function, the cause and the remedy. The call writes at most
/// `cap` bytes to `buf`, NUL included, and cuts a longer message. Calls that succeed leave the message as it is.
///
/// Returns the length of the whole message without NUL, 0 if no call failed yet. To ask for the length alone, `buf` may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_last_error(buf: *mut c_char, cap: usize) -> usize {
    // SAFETY: the caller vouches for `cap` bytes at `buf`.
    guard_value(0, || unsafe { status::copy_text(&status::last(), buf, cap) })
}
