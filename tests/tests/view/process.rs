//! Starts a command with a viewer, and reads its stream as the page does.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use dcd_tests::socket;
use tungstenite::{Bytes, Message, WebSocket};

/// A limit that nothing here comes near, even on a busy machine.
const LIMIT: Duration = Duration::from_secs(60);

/// A process of the command line; dropping it kills it.
pub(crate) struct Process {
    child: Child,
    said: Receiver<String>,
    heard: Vec<String>,
}

impl Process {
    pub(crate) fn start(args: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_dcd-under-test"))
            .args(args)
            .env_remove("RUST_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary was built for this test");
        let (sender, said) = channel();
        let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        for lines in [Box::new(out) as Box<dyn std::io::Read + Send>, Box::new(err)] {
            let sender = sender.clone();
            std::thread::spawn(move || {
                BufReader::new(lines).lines().map_while(Result::ok).for_each(|line| drop(sender.send(line)));
            });
        }
        Self { child, said, heard: Vec::new() }
    }

    /// Waits for the first line with this prefix that has not been returned yet, and returns the rest of it.
    /// Lines before it are kept, since the two outputs of a process have no common order.
    pub(crate) fn line(&mut self, prefix: &str) -> String {
        loop {
            if let Some(at) = self.heard.iter().position(|line| line.starts_with(prefix)) {
                return self.heard.remove(at)[prefix.len()..].to_owned();
            }
            match self.said.recv_timeout(LIMIT) {
                Ok(line) => self.heard.push(line),
                Err(error) => panic!("no line `{prefix}…` ({error}): {:?}", self.heard),
            }
        }
    }

    /// Waits for the end of the process, and returns its exit code.
    pub(crate) fn ended(mut self) -> Option<i32> {
        self.child.wait().unwrap().code()
    }

    /// Interrupts the process as Ctrl-C does, and returns its exit code.
    pub(crate) fn interrupt(mut self) -> Option<i32> {
        let sent = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the address and the key in a URL that a command prints.
pub(crate) fn parts(url: &str) -> (String, String) {
    let (address, key) = url.strip_prefix("http://").unwrap().split_once("/?key=").unwrap();
    (address.to_owned(), key.to_owned())
}

/// A movable body of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) at: [f32; 3],
    pub(crate) turn: [f32; 4],
    pub(crate) owner: u8,
    pub(crate) present: bool,
}

/// What a page knows after an answer.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) controls: bool,
    /// The first and the last tick of a recording.
    pub(crate) recorded: Option<[f64; 2]>,
    pub(crate) movable: usize,
    pub(crate) fixed: usize,
    pub(crate) frames: usize,
    pub(crate) tick: f64,
    pub(crate) regions: usize,
    /// The node that computes each region.
    pub(crate) nodes: Vec<u32>,
    pub(crate) rows: Vec<Row>,
    pub(crate) ghosts: usize,
    pub(crate) contacts: usize,
    pub(crate) samples: usize,
    pub(crate) paused: bool,
    /// Says whether a recording is on its way to a tick.
    pub(crate) going: bool,
    pub(crate) oldest: f64,
    pub(crate) newest: f64,
    pub(crate) details: Option<serde_json::Value>,
}

/// A page that reads the stream.
pub(crate) struct Page {
    pub(crate) socket: WebSocket<TcpStream>,
    pub(crate) seen: Seen,
}

pub(crate) const SEE: u8 = 1;
pub(crate) const PAST: u8 = 2;
pub(crate) const PAUSE: u8 = 3;
pub(crate) const STEP: u8 = 4;
pub(crate) const SPEED: u8 = 5;
pub(crate) const CONTACTS: u8 = 6;
pub(crate) const CHOOSE: u8 = 7;
pub(crate) const GO: u8 = 9;

impl Page {
    pub(crate) fn open(url: &str) -> Result<Self, String> {
        let (address, key) = parts(url);
        let socket = socket::open(
            &address,
            &format!("/stream?key={key}"),
            &address,
            Some(&format!("http://{address}")),
        )?;
        Ok(Self { socket, seen: Seen::default() })
    }

    pub(crate) fn ask(&mut self, what: u8, number: u64) {
        let message = [&[what][..], &number.to_le_bytes()].concat();
        self.socket.send(Message::binary(message)).unwrap();
    }

    /// Asks for a picture, and takes in the answer.
    pub(crate) fn look(&mut self, what: u8, number: u64) {
        assert!(self.try_look(what, number), "the viewer is gone");
    }

    /// Asks for a picture, and returns whether the viewer was still there.
    pub(crate) fn try_look(&mut self, what: u8, number: u64) -> bool {
        let message = [&[what][..], &number.to_le_bytes()].concat();
        if self.socket.send(Message::binary(message)).is_err() {
            return false;
        }
        loop {
            match self.socket.read() {
                Ok(Message::Binary(message)) if self.take(&message) => return true,
                Ok(_) => {}
                Err(_) => return false,
            }
        }
    }

    /// Asks for pictures until the condition holds.
    pub(crate) fn until(&mut self, what: &str, is_so: impl Fn(&Seen) -> bool) {
        let start = std::time::Instant::now();
        while !is_so(&self.seen) {
            assert!(start.elapsed() < LIMIT, "not within {LIMIT:?}: {what}");
            self.look(SEE, 0);
        }
    }

    /// Takes in the pictures that were on their way when the world was paused.
    pub(crate) fn skip_late(&mut self) {
        let mut before = None;
        while before != Some(self.seen.frames) {
            before = Some(self.seen.frames);
            self.look(SEE, 0);
        }
    }

    /// Takes in a message. Returns whether it was the last of an answer.
    fn take(&mut self, message: &Bytes) -> bool {
        let u32 = |at: usize| u32::from_le_bytes(message[at..at + 4].try_into().unwrap());
        let f32 = |at: usize| f32::from_bits(u32(at));
        let f64 = |at: usize| f64::from_le_bytes(message[at..at + 8].try_into().unwrap());
        let seen = &mut self.seen;
        match message[0] {
            1 => {
                seen.controls = message[2] == 1;
                seen.recorded = (message[3] == 1).then(|| [f64(80), f64(88)]);
            }
            3 if u32(4) >> 31 == 1 => seen.fixed += 1,
            3 => seen.movable += 1,
            4 => {
                let [regions, borders, count, ghosts, contacts] =
                    [16, 20, 24, 28, 32].map(|at| u32(at) as usize);
                (seen.frames, seen.tick) = (seen.frames + 1, f64(8));
                (seen.regions, seen.ghosts, seen.contacts) = (regions, ghosts, contacts);
                seen.nodes = (0..regions).map(|place| u32(44 + 48 * place)).collect();
                let places = 40 + 48 * regions + 16 * borders;
                let (turns, marks) = (places + 12 * count, places + 20 * count);
                assert_eq!(message.len(), places + 24 * count + 8 * ghosts + 24 * contacts);
                let turn = |at: usize| {
                    f32::from(i16::from_le_bytes(message[at..at + 2].try_into().unwrap())) / 32767.0
                };
                let row = |i: usize| Row {
                    at: std::array::from_fn(|k| f32(places + 12 * i + 4 * k)),
                    turn: std::array::from_fn(|k| turn(turns + 8 * i + 2 * k)),
                    owner: message[marks + 4 * i],
                    present: message[marks + 4 * i + 1] & 1 == 1,
                };
                seen.rows = (0..count).map(row).collect();
            }
            5 => seen.samples += u32(4) as usize,
            6 => {
                (seen.paused, seen.going) = (message[1] == 1, message[2] == 1);
                (seen.oldest, seen.newest) = (f64(8), f64(16));
                return true;
            }
            b'{' => seen.details = Some(serde_json::from_slice(message).unwrap()),
            2 | 7 => {}
            other => panic!("a message of kind {other}"),
        }
        false
    }
}
