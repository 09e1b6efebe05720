//! Ctrl-C: the first asks a command to end in order, the second ends it at once.

use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use super::failure::Failure;

/// Exit code of what was ended by Ctrl-C: 128 + SIGINT.
const EXIT: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<Result<(), String>> = OnceLock::new();

/// Proof that Ctrl-C is heard from here on.
#[derive(Clone, Copy)]
pub(super) struct Interrupt(());

impl Interrupt {
    /// Takes Ctrl-C over for the rest of the process.
    pub(super) fn listen() -> Result<Self, Failure> {
        let handler = || {
            if ASKED.swap(true, Ordering::SeqCst) {
                std::process::exit(EXIT.into());
            }
        };
        let installed =
            INSTALLED.get_or_init(|| ctrlc::set_handler(handler).map_err(|error| error.to_string()));
        match installed {
            Ok(()) => Ok(Self(())),
            Err(cause) => Err(Failure::run(format!(
                "cannot listen for Ctrl-C: {cause}; run without a handler of your own"
            ))),
        }
    }

    /// Whether the user asked for an end.
    pub(super) fn asked(self) -> bool {
        ASKED.load(Ordering::SeqCst)
    }

    /// The exit code of a command that ended in order.
    pub(super) fn exit_code(self) -> ExitCode {
        if self.asked() { ExitCode::from(EXIT) } else { ExitCode::SUCCESS }
    }
}
