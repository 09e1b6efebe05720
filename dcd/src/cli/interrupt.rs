//! Handles Ctrl-C and SIGTERM: the first asks a command to end in order, a later one ends it at once.

use std::io::Read;
use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::failure::Failure;

/// Exit code of a command that Ctrl-C ended: 128 + SIGINT.
const EXIT: u8 = 130;

/// Time in which one press may be heard twice: from the terminal, and from a parent process that passes on what it hears.
const ONE_PRESS: Duration = Duration::from_millis(200);

static FIRST: OnceLock<Instant> = OnceLock::new();
static SIGNALLED: AtomicBool = AtomicBool::new(false);
static ABANDONED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<Result<(), String>> = OnceLock::new();

/// A proof that Ctrl-C is heard from here on.
#[derive(Clone, Copy)]
pub(super) struct Interrupt(());

impl Interrupt {
    /// Takes over Ctrl-C for the rest of the process.
    pub(super) fn listen() -> Result<Self, Failure> {
        let handler = || {
            let first = FIRST.get_or_init(Instant::now);
            SIGNALLED.store(true, Ordering::SeqCst);
            if first.elapsed() > ONE_PRESS {
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

    /// Takes the end of standard input as a request to end too: a parent process ends its children in order with it, on every
    /// system, and they do not outlive a parent that is killed.
    pub(super) fn listen_to_stdin(self) {
        std::thread::spawn(|| {
            let mut stdin = std::io::stdin().lock();
            let mut ignored = [0; 64];
            while matches!(stdin.read(&mut ignored), Ok(1..)) {}
            ABANDONED.store(true, Ordering::SeqCst);
        });
    }

    /// Returns whether the user asked for an end.
    pub(super) fn asked(self) -> bool {
        SIGNALLED.load(Ordering::SeqCst) || ABANDONED.load(Ordering::SeqCst)
    }

    /// Returns the exit code of a command that ended in order.
    pub(super) fn exit_code(self) -> ExitCode {
        if SIGNALLED.load(Ordering::SeqCst) { ExitCode::from(EXIT) } else { ExitCode::SUCCESS }
    }
}
