//! Reports bugs of the library to one C function where they are found.

use std::cell::Cell;
use std::ffi::{CString, c_char, c_void};
use std::panic::PanicHookInfo;
use std::sync::{Once, PoisonError, RwLock};

use crate::callback::{Callback, check_outside, enter};
use crate::guard::{guard, panic_message};
use crate::status::DcdStatus;

/// Receives a report of a bug: `message` says what does not hold, `file` and `line` where in the library's source. The texts are
/// valid during the call.
pub type DcdBugFn = Option<
    unsafe extern "C" fn(context: *mut c_void, message: *const c_char, file: *const c_char, line: u32),
>;

/// Sets the function that is called where the library finds a bug of its own: an assertion that fails, or a panic. Use it to stop
/// in a debugger, or to write a report with a stack trace.
///
/// The function runs on the thread and stack where the bug happens, before the call that met it returns DCD_ERR_PANIC. Without a
/// function, and after a null one, the library writes a line about the bug to stderr. When this call returns, the former function
/// is not running and will not be called again.
///
/// One function serves the whole process, also for panics of the program's own parts in Rust. Any thread may call it, several
/// threads at a time. It must return normally or end the process (no longjmp, no C++ exception). Calls on worlds from within it
/// give DCD_ERR_BUSY.
/// Errors: DCD_ERR_BUSY (called from within a function that the library calls).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_bug_set(function: DcdBugFn, context: *mut c_void) -> DcdStatus {
    guard("dcd_bug_set", || {
        check_outside()?;
        install();
        let mut told = TOLD.write().unwrap_or_else(PoisonError::into_inner);
        *told = function.map(|function| Told { function, context });
        Ok(())
    })
}

/// The user's function, and the context it is called with.
struct Told {
    function: unsafe extern "C" fn(*mut c_void, *const c_char, *const c_char, u32),
    context: *mut c_void,
}

// SAFETY: the header asks for a function that any thread may call with this pointer.
unsafe impl Send for Told {}
// SAFETY: as above.
unsafe impl Sync for Told {}

static TOLD: RwLock<Option<Told>> = RwLock::new(None);

thread_local! {
    /// Says whether this thread is in the user's function: a panic within it is not reported to it.
    static TELLING: Cell<bool> = const { Cell::new(false) };
}

fn install() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let former = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !tell(info) {
                former(info);
            }
        }));
    });
}

/// Calls the user's function. Returns false if there is none, or if this thread is within it.
fn tell(info: &PanicHookInfo<'_>) -> bool {
    let told = TOLD.read().unwrap_or_else(PoisonError::into_inner);
    let Some(told) = told.as_ref().filter(|_| !TELLING.replace(true)) else { return false };
    let text = |text: &str| CString::new(text.replace('\0', "?")).unwrap_or_default();
    let message = text(panic_message(info.payload()));
    let (file, line) = info.location().map_or(("", 0), |at| (at.file(), at.line()));
    let file = text(file);
    // SAFETY: the caller of dcd_bug_set vouches for the function.
    enter(Callback::Bug, || unsafe { (told.function)(told.context, message.as_ptr(), file.as_ptr(), line) });
    TELLING.set(false);
    true
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;
    use std::sync::Mutex;

    use super::*;
    use crate::status::{DCD_ERR_BUSY, DCD_ERR_PANIC, DCD_OK};

    static HEARD: Mutex<Vec<(String, String, DcdStatus)>> = Mutex::new(Vec::new());

    unsafe extern "C" fn note(_: *mut c_void, message: *const c_char, file: *const c_char, line: u32) {
        // SAFETY: both texts end with NUL and are valid during the call.
        let (message, file) = unsafe { (CStr::from_ptr(message), CStr::from_ptr(file)) };
        // SAFETY: a null function has nothing to uphold.
        let within = unsafe { dcd_bug_set(None, std::ptr::null_mut()) };
        let message = message.to_str().unwrap().to_owned();
        if message.starts_with("on purpose") {
            let at = format!("{}:{}", file.to_str().unwrap(), u32::from(line > 0));
            HEARD.lock().unwrap().push((message, at, within));
        }
    }

    #[test]
    fn a_bug_is_told_where_it_is_found_and_no_more_after_null() {
        let set = |function| {
            // SAFETY: `note` takes any context.
            assert_eq!(unsafe { dcd_bug_set(function, std::ptr::null_mut()) }, DCD_OK);
        };
        set(Some(note));
        assert_eq!(guard("dcd_test", || panic!("on purpose {}", 1)), DCD_ERR_PANIC);
        set(None);
        assert_eq!(guard("dcd_test", || panic!("on purpose 2")), DCD_ERR_PANIC);
        let heard = HEARD.lock().unwrap();
        let here = format!("{}:1", file!());
        assert_eq!(*heard, [("on purpose 1".to_owned(), here, DCD_ERR_BUSY)]);
    }
}
