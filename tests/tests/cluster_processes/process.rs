//! Starts real processes of the command line, waits for them with a limit, and kills them by their handles
//! when a test is over.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use dcd_tests::proxy::free_address;
use serde_json::Value;

use crate::witness::Witness;

/// A limit that nothing here comes near, even on a busy machine.
pub(crate) const LIMIT: Duration = Duration::from_secs(30);

/// Returns a guard for tests that measure times: they run one after the other, and not beside tests that load
/// the machine.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static CLOCK: Mutex<()> = Mutex::new(());
    CLOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The program under test.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_dcd-under-test");

/// Returns a command of the program under test. It hears all signals, even if the tests run where some are
/// ignored, as under `nohup`.
pub(crate) fn dcd(args: &[&str]) -> Command {
    let mut command = match cfg!(target_os = "linux") {
        true => Command::new("env"),
        false => Command::new(PROGRAM),
    };
    if cfg!(target_os = "linux") {
        command.args(["--default-signal=HUP,INT", PROGRAM]);
    }
    command.args(args).env_remove("RUST_LOG");
    command
}

/// A running child.
pub(crate) struct Process {
    child: Child,
    lines: Receiver<String>,
    reader: Option<JoinHandle<()>>,
    errors: Option<JoinHandle<String>>,
}

/// How a child ended, and its output since it was last read.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    pub(crate) lines: Vec<String>,
    pub(crate) errors: String,
}

impl Process {
    pub(crate) fn start(command: &mut Command) -> Self {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary was built for this test");
        let (sender, lines) = mpsc::channel();
        let out = BufReader::new(child.stdout.take().unwrap());
        let mut err = child.stderr.take().unwrap();
        let reader = std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                let _ = sender.send(line);
            }
        });
        let errors = std::thread::spawn(move || {
            let mut text = String::new();
            let _ = err.read_to_string(&mut text);
            text
        });
        Self { child, lines, reader: Some(reader), errors: Some(errors) }
    }

    /// Waits for the next line that begins with `prefix`, and returns the rest of it.
    pub(crate) fn line(&mut self, prefix: &str) -> String {
        let deadline = Instant::now() + LIMIT;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    if let Some(rest) = line.strip_prefix(prefix) {
                        return rest.to_owned();
                    }
                }
                Err(error) => {
                    self.kill();
                    let said = self.errors.take().map(|errors| errors.join().unwrap_or_default());
                    panic!("no line `{prefix}…` ({error}); standard error: {said:?}");
                }
            }
        }
    }

    /// Returns the lines since the output was last read.
    pub(crate) fn heard(&mut self) -> Vec<String> {
        self.lines.try_iter().collect()
    }

    /// Returns the process id.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Interrupts the process, as Ctrl-C does.
    pub(crate) fn interrupt(&self) {
        self.signal("-INT");
    }

    /// Sends a signal, by its name for `kill`.
    pub(crate) fn signal(&self, name: &str) {
        signal(self.id(), name);
    }

    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Kills the process, as a crash would.
    pub(crate) fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Waits for the end of the process.
    pub(crate) fn end(mut self) -> Ended {
        self.end_within(LIMIT)
    }

    pub(crate) fn end_within(&mut self, limit: Duration) -> Ended {
        let deadline = Instant::now() + limit;
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < deadline, "it did not end within {limit:?}");
            std::thread::sleep(Duration::from_millis(10));
        };
        let _ = self.reader.take().map(JoinHandle::join);
        let errors = self.errors.take().map(|errors| errors.join().unwrap()).unwrap_or_default();
        Ended { status, lines: self.lines.try_iter().collect(), errors }
    }
}

/// Sends a signal to the process with this id, by the signal's name for `kill`.
pub(crate) fn signal(id: u32, name: &str) {
    let sent = Command::new("kill").args([name, &id.to_string()]).status().unwrap();
    assert!(sent.success());
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

impl Ended {
    /// Returns the JSON object in the last line.
    pub(crate) fn json(&self) -> Value {
        let last = self.lines.last().unwrap_or_else(|| panic!("it printed nothing: {}", self.errors));
        serde_json::from_str(last).unwrap_or_else(|_| panic!("{last}: {}", self.errors))
    }

    pub(crate) fn code(&self) -> Option<i32> {
        self.status.code()
    }
}

/// A server process with its data folder.
pub(crate) struct Server {
    pub(crate) process: Process,
    pub(crate) address: String,
    pub(crate) folder: tempfile::TempDir,
    args: Vec<String>,
}

impl Server {
    /// Serves a scene. The server prints JSON at its end.
    pub(crate) fn start(args: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let args: Vec<_> = args.iter().map(|&arg| arg.to_owned()).collect();
        // An address at which it can listen again.
        let listen = free_address().to_string();
        let (process, address) = serve(&listen, &folder.path().join("data"), &args);
        Self { process, address, folder, args }
    }

    /// Starts another process with the same folder and address; the former one must have ended. Returns the
    /// tick from which it goes on.
    pub(crate) fn restart(&mut self) -> u64 {
        let (process, address) = serve(&self.address, &self.data(), &self.args);
        assert_eq!(address, self.address);
        self.process = process;
        self.process.line("going on with the world at tick ").parse().expect("a number")
    }

    /// Serves the demo's world, in two regions.
    pub(crate) fn playground(nodes: &str) -> Self {
        Self::start(&[playground().to_str().unwrap(), "--nodes", nodes])
    }

    pub(crate) fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    pub(crate) fn token(&self, role: &str) -> String {
        token(&self.data(), role)
    }

    /// Starts a node, and returns its name and process.
    pub(crate) fn node(&self) -> (String, Process) {
        self.node_with(&[])
    }

    pub(crate) fn node_with(&self, more: &[&str]) -> (String, Process) {
        let token = self.token("node");
        let args = ["node", "--json", "--threads", "1", "--server", &self.address, "--token", &token];
        let mut node = Process::start(dcd(&args).args(more));
        let name = node.line("joined as ");
        (name, node)
    }

    /// Joins a client that watches.
    pub(crate) fn witness(&self) -> Witness {
        Witness::join(&self.address, self.token("client"))
    }

    /// Waits for the next view, and returns its line.
    pub(crate) fn view(&mut self) -> String {
        self.process.line("view ")
    }

    /// Ends the world by `dcd end`, and returns the server's summary. No body may be lost or doubled.
    pub(crate) fn stop(mut self) -> Value {
        self.end_world()
    }

    /// The same, if the folder is looked at afterwards.
    pub(crate) fn end_world(&mut self) -> Value {
        let ended = self.ended();
        let summary = ended.json();
        assert_eq!((ended.code(), &summary["audited"]), (Some(0), &true.into()), "{ended:?}");
        summary
    }

    /// Ends a world of which no node is heard, so that nobody says what is lost.
    pub(crate) fn end_unheard(&mut self) {
        let ended = self.ended();
        assert_eq!((ended.code(), &ended.json()["audited"]), (Some(3), &false.into()), "{ended:?}");
        assert!(ended.errors.contains("did not say at the end what they own"), "{ended:?}");
    }

    fn ended(&mut self) -> Ended {
        let told = Process::start(dcd(&["end", "--data"]).arg(self.data())).end();
        assert_eq!(told.code(), Some(0), "{told:?}");
        assert!(told.lines[0].contains("its server has stopped"), "{told:?}");
        let ended = self.process.end_within(LIMIT);
        let summary = ended.json();
        assert_eq!((&summary["lost"], &summary["doubled"]), (&0.into(), &0.into()), "{ended:?}");
        assert_eq!(summary["kept"], false, "{ended:?}");
        ended
    }
}

fn serve(listen: &str, data: &Path, args: &[String]) -> (Process, String) {
    let mut command = dcd(&["serve", "--listen", listen, "--json", "--data"]);
    let mut process = Process::start(command.arg(data).args(args));
    let address = process.line("listening ");
    (process, address)
}

pub(crate) fn playground() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../dcd/scenes/playground.toml")
}

pub(crate) fn token(data: &Path, role: &str) -> String {
    let ended = Process::start(dcd(&["token", "--role", role, "--data"]).arg(data)).end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    ended.lines[0].clone()
}
