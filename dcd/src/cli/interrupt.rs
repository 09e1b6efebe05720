//! Handles Ctrl-C, SIGTERM and SIGHUP. The first signal asks a command to end in order; a signal that the
//! command does not expect ends it at once.

use std::io::{self, Read};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use tokio::runtime::Runtime;

use super::failure::Failure;

/// The exit code of a command that Ctrl-C ended: 128 + SIGINT.
const EXIT: u8 = 130;

/// The time in which one press may arrive twice: from the terminal, and from a parent process that passes on
/// what it hears.
const ONE_PRESS: Duration = Duration::from_millis(200);

static LAST: Mutex<Option<Instant>> = Mutex::new(None);
/// The number of signals that were heard, of every kind.
static SIGNALS: AtomicU32 = AtomicU32::new(0);
/// The number of those that were Ctrl-C.
static PRESSES: AtomicU32 = AtomicU32::new(0);
/// The number of signals that the command expects.
static EXPECTED: AtomicU32 = AtomicU32::new(1);
static ABANDONED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<Result<(), String>> = OnceLock::new();

/// A kind of signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Heard {
    /// Ctrl-C.
    Press,
    /// SIGTERM.
    #[cfg_attr(not(unix), expect(dead_code, reason = "Unix has it"))]
    Termination,
    /// SIGHUP: the terminal is gone.
    #[cfg_attr(not(unix), expect(dead_code, reason = "Unix has it"))]
    HangUp,
}

/// A proof that Ctrl-C is heard from here on.
#[derive(Clone, Copy)]
pub(super) struct Interrupt(());

impl Interrupt {
    /// Takes over Ctrl-C, SIGTERM and SIGHUP for the rest of the process. SIGHUP stays ignored if the process
    /// was started to ignore it, as by `nohup`. Ctrl-C is heard even then: scripts ignore it for what they
    /// start in the background, and yet end that by it.
    pub(super) fn listen() -> Result<Self, Failure> {
        match INSTALLED.get_or_init(|| install().map_err(|error| error.to_string())) {
            Ok(()) => Ok(Self(())),
            Err(cause) => Err(Failure::run(format!(
                "cannot listen for Ctrl-C: {cause}; raise the limits of threads and open files"
            ))),
        }
    }

    /// Takes the end of standard input as a request to end, too. A parent process can thus end its children
    /// in order on every system, and they do not outlive a parent that is killed.
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

    /// Expects a second signal, and waits for it for this time. Returns whether the user has pressed Ctrl-C
    /// twice, which means something else than once.
    pub(super) fn asked_again(self, within: Duration) -> bool {
        const LOOK: Duration = Duration::from_millis(20);
        EXPECTED.store(2, Ordering::SeqCst);
        let deadline = Instant::now() + within;
        let heard = || SIGNALS.load(Ordering::SeqCst);
        while heard() < 2 && Instant::now() < deadline {
            std::thread::sleep(LOOK);
        }
        PRESSES.load(Ordering::SeqCst) > 1
    }

    /// Does what may wait long and leaves nothing to be ended in order, as dialling a server. A signal ends the
    /// process meanwhile, also one that was heard before.
    pub(super) fn at_once<T>(self, work: impl FnOnce() -> T) -> T {
        let expected = EXPECTED.swap(0, Ordering::SeqCst);
        if self.signalled() {
            std::process::exit(EXIT.into());
        }
        let done = work();
        EXPECTED.store(expected, Ordering::SeqCst);
        done
    }

    /// Returns whether the user pressed Ctrl-C.
    pub(super) fn pressed(self) -> bool {
        PRESSES.load(Ordering::SeqCst) > 0
    }

    fn signalled(self) -> bool {
        SIGNALS.load(Ordering::SeqCst) > 0
    }

    /// Returns the exit code of a command that ended in order.
    pub(super) fn exit_code(self) -> ExitCode {
        if self.signalled() { ExitCode::from(EXIT) } else { ExitCode::SUCCESS }
    }
}

/// Counts a signal; one that the command does not expect ends the process.
fn hear(heard: Heard) {
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if last.is_some_and(|last| last.elapsed() <= ONE_PRESS) {
        return;
    }
    *last = Some(Instant::now());
    let former = SIGNALS.load(Ordering::SeqCst);
    // Shells and systems send SIGHUP several times; once an end was asked for, more of them ask for nothing
    // new.
    if heard == Heard::HangUp && former > 0 && former >= EXPECTED.load(Ordering::SeqCst) {
        return;
    }
    if heard == Heard::Press {
        PRESSES.fetch_add(1, Ordering::SeqCst);
    }
    SIGNALS.store(former + 1, Ordering::SeqCst);
    if former >= EXPECTED.load(Ordering::SeqCst) {
        std::process::exit(EXIT.into());
    }
}

/// Starts a thread that hears signals.
fn install() -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    listen_by(&runtime)?;
    let hears = move || runtime.block_on(std::future::pending::<()>());
    std::thread::Builder::new().name("dcd-signals".to_owned()).spawn(hears).map(drop)
}

#[cfg(unix)]
fn listen_by(runtime: &Runtime) -> io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let _within = runtime.enter();
    let ignored = ignored();
    for (kind, heard) in [
        (SignalKind::interrupt(), Heard::Press),
        (SignalKind::terminate(), Heard::Termination),
        (SignalKind::hangup(), Heard::HangUp),
    ] {
        if heard == Heard::HangUp && ignored & 1 << (kind.as_raw_value() - 1) != 0 {
            continue;
        }
        let mut signals = signal(kind)?;
        runtime.spawn(async move {
            while signals.recv().await.is_some() {
                hear(heard);
            }
        });
    }
    Ok(())
}

/// Returns the signals that the process was started to ignore, as bits; 0 where the system does not say.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let bits = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    bits.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(not(unix))]
fn listen_by(runtime: &Runtime) -> io::Result<()> {
    runtime.spawn(async {
        while tokio::signal::ctrl_c().await.is_ok() {
            hear(Heard::Press);
        }
    });
    Ok(())
}
