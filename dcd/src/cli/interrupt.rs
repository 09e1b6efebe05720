//! Handles Ctrl-C, SIGTERM and SIGHUP: the first asks a command to end in order, one that it does not expect ends it at once.

use std::io::Read;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use super::failure::Failure;

/// Exit code of a command that Ctrl-C ended: 128 + SIGINT.
const EXIT: u8 = 130;

/// Time in which one press may be heard twice: from the terminal, and from a parent process that passes on what it hears.
const ONE_PRESS: Duration = Duration::from_millis(200);

static LAST: Mutex<Option<Instant>> = Mutex::new(None);
static PRESSES: AtomicU32 = AtomicU32::new(0);
/// Presses that the command obeys.
static EXPECTED: AtomicU32 = AtomicU32::new(1);
static ABANDONED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<Result<(), String>> = OnceLock::new();

/// A proof that Ctrl-C is heard from here on.
#[derive(Clone, Copy)]
pub(super) struct Interrupt(());

impl Interrupt {
    /// Takes over Ctrl-C for the rest of the process.
    pub(super) fn listen() -> Result<Self, Failure> {
        let handler = || {
            let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
            if last.is_some_and(|last| last.elapsed() <= ONE_PRESS) {
                return;
            }
            *last = Some(Instant::now());
            if PRESSES.fetch_add(1, Ordering::SeqCst) >= EXPECTED.load(Ordering::SeqCst) {
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
        self.signalled() || ABANDONED.load(Ordering::SeqCst)
    }

    /// Returns whether a second press comes within this time, which means something else than the first.
    pub(super) fn asked_again(self, within: Duration) -> bool {
        const LOOK: Duration = Duration::from_millis(20);
        EXPECTED.store(2, Ordering::SeqCst);
        let deadline = Instant::now() + within;
        while PRESSES.load(Ordering::SeqCst) < 2 && Instant::now() < deadline {
            std::thread::sleep(LOOK);
        }
        PRESSES.load(Ordering::SeqCst) > 1
    }

    fn signalled(self) -> bool {
        PRESSES.load(Ordering::SeqCst) > 0
    }

    /// Returns the exit code of a command that ended in order.
    pub(super) fn exit_code(self) -> ExitCode {
        if self.signalled() { ExitCode::from(EXIT) } else { ExitCode::SUCCESS }
    }
}
