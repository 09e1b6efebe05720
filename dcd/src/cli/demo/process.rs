//! Runs a child process that is waited for with a bound, and never outlives its handle.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::cli::failure::Failure;
use crate::cli::interrupt::Interrupt;

/// The interval at which Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);
/// The time that a child gets to end in order when its handle is dropped.
const PATIENCE: Duration = Duration::from_secs(3);
/// The most lines of a child's standard error that are kept to explain a failure.
const KEPT: usize = 30;

/// The end of a child's standard error.
#[derive(Clone)]
struct Errors {
    lines: Arc<Mutex<VecDeque<String>>>,
    echoed: bool,
}

/// A running child process. Its standard input stays open until it is to end.
pub(super) struct Process {
    name: String,
    child: Child,
    lines: Receiver<String>,
    errors: Errors,
    readers: Vec<JoinHandle<()>>,
}

impl Process {
    /// Starts a child. `name` is its name in messages. With `echo` its standard error is passed on line by
    /// line.
    pub(super) fn start(name: impl Into<String>, command: &mut Command, echo: bool) -> Result<Self, Failure> {
        let name = name.into();
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Ctrl-C is for the demo, which ends its children in the right order.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let mut child = command.spawn().map_err(|error| {
            let program = command.get_program().display();
            Failure::run(format!(
                "cannot start {name} ({program}): {error}; check that it is installed and on the PATH"
            ))
        })?;
        let (sender, lines) = mpsc::channel();
        let errors = Arc::new(Mutex::new(VecDeque::new()));
        let kept = errors.clone();
        let out = child.stdout.take().expect("it is piped");
        let err = child.stderr.take().expect("it is piped");
        let readers = vec![
            std::thread::spawn(move || each_line(out, |line| drop(sender.send(line)))),
            std::thread::spawn(move || {
                each_line(err, |line| {
                    if echo {
                        eprintln!("  {line}");
                    }
                    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                    kept.push_back(line);
                    if kept.len() > KEPT {
                        kept.pop_front();
                    }
                });
            }),
        ];
        Ok(Self { name, child, lines, errors: Errors { lines: errors, echoed: echo }, readers })
    }

    /// Waits for the next line on its standard output that begins with `prefix`.
    pub(super) fn line(
        &mut self,
        prefix: &str,
        limit: Duration,
        interrupt: Interrupt,
    ) -> Result<String, Failure> {
        let deadline = Instant::now() + limit;
        loop {
            if interrupt.asked() {
                return Err(Failure::interrupted());
            }
            match self.lines.recv_timeout(LOOK) {
                Ok(line) if line.starts_with(prefix) => return Ok(line),
                Ok(_) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(self.failed(&format!("ended without saying `{prefix}…`")));
                }
                Err(RecvTimeoutError::Timeout) if Instant::now() < deadline => {}
                Err(RecvTimeoutError::Timeout) => {
                    return Err(self.failed(&format!("did not say `{prefix}…` within {limit:?}")));
                }
            }
        }
    }

    /// Waits until the child ends by itself. Returns the lines of its standard output that [`Process::line`]
    /// did not read.
    pub(super) fn finish(
        mut self,
        limit: Duration,
        interrupt: Interrupt,
    ) -> Result<(ExitStatus, Vec<String>), Failure> {
        let deadline = Instant::now() + limit;
        let status = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break status,
                Ok(None) if interrupt.asked() => return Err(Failure::interrupted()),
                Ok(None) if Instant::now() < deadline => std::thread::sleep(LOOK),
                Ok(None) => return Err(self.failed(&format!("did not end within {limit:?}"))),
                Err(error) => return Err(self.failed(&format!("cannot be waited for ({error})"))),
            }
        };
        for reader in self.readers.drain(..) {
            let _ = reader.join();
        }
        Ok((status, self.lines.try_iter().collect()))
    }

    /// Waits as [`Process::finish`] does, but returns a failure of the child as an error.
    pub(super) fn succeed(self, limit: Duration, interrupt: Interrupt) -> Result<Vec<String>, Failure> {
        let (name, errors) = (self.name.clone(), self.errors.clone());
        match self.finish(limit, interrupt)? {
            (status, lines) if status.success() => Ok(lines),
            (status, _) => Err(explained(&name, &format!("failed ({status})"), &errors)),
        }
    }

    /// Asks the child to end in order, by the end of its standard input.
    pub(super) fn end(&mut self) {
        self.child.stdin.take();
    }

    /// Ends the child at once, as a crash of its machine would.
    pub(super) fn kill(mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Returns a failure that says what the child did not do, with the end of its standard error.
    pub(super) fn failed(&self, what: &str) -> Failure {
        explained(&self.name, what, &self.errors)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
        let deadline = Instant::now() + PATIENCE;
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < deadline {
            std::thread::sleep(LOOK);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn each_line(from: impl Read, mut take: impl FnMut(String)) {
    let mut from = BufReader::new(from);
    let mut bytes = Vec::new();
    while matches!(from.read_until(b'\n', &mut bytes), Ok(1..)) {
        take(String::from_utf8_lossy(&bytes).trim_end().to_owned());
        bytes.clear();
    }
}

fn explained(name: &str, what: &str, errors: &Errors) -> Failure {
    let echoed = errors.echoed;
    let errors = errors.lines.lock().unwrap_or_else(PoisonError::into_inner);
    let said = match errors.is_empty() {
        true => "it said nothing on standard error".to_owned(),
        false if echoed => "see what it said above".to_owned(),
        false => format!("its last words:\n  {}", errors.iter().cloned().collect::<Vec<_>>().join("\n  ")),
    };
    Failure::run(format!("{name} {what}; {said}"))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str) -> Process {
        Process::start("the shell", Command::new("sh").args(["-c", script]), false).unwrap()
    }

    fn interrupt() -> Interrupt {
        Interrupt::listen().unwrap()
    }

    #[test]
    fn lines_are_waited_for_with_a_bound_and_errors_have_its_last_words() {
        let mut child = shell("echo ignored; echo ready now; echo trouble >&2; read end");
        assert_eq!(child.line("ready", PATIENCE, interrupt()).unwrap(), "ready now");
        let late = format!("{:?}", child.line("more", Duration::from_millis(200), interrupt()).unwrap_err());
        assert!(late.contains("did not say `more…`") && late.contains("trouble"), "{late}");
        child.end();
        let gone = format!("{:?}", child.line("more", PATIENCE, interrupt()).unwrap_err());
        assert!(gone.contains("ended without saying"), "{gone}");
        let failure = format!("{:?}", shell("exit 3").succeed(PATIENCE, interrupt()).unwrap_err());
        assert!(failure.contains("exit status: 3"), "{failure}");
    }

    #[test]
    fn a_child_that_hears_nothing_does_not_outlive_its_handle() {
        let mut child = shell("trap '' TERM INT; echo ready; exec 0<&-; while :; do sleep 0.1; done");
        child.line("ready", PATIENCE, interrupt()).unwrap();
        let id = child.child.id().to_string();
        drop(child);
        let alive = Command::new("kill").args(["-0", &id]).stderr(Stdio::null()).status().unwrap();
        assert!(!alive.success());
    }
}
