//! Serves the page and the stream to browsers: a thread that listens, and one for each connection.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Bytes, Error, Message, WebSocket};

use super::http::{self, Refused, Request};
use super::hub::{Hub, Progress, Want};
use super::page;
use crate::http::Timely;
use crate::priority::give_way;
use crate::space::BodyId;

/// The most connections at a time; browsers open some for the files of the page.
const MOST_CONNECTIONS: usize = 64;
/// The most time for a request to arrive, and for the browser to take its answer.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// The most time for which a browser may take nothing of what it is sent. A browser that asks for nothing is
/// sent a ping after this time, and then has as long again to answer.
const STREAM_TIMEOUT: Duration = Duration::from_secs(60);
/// How long an answer waits for a newer picture.
const NEWS: Duration = Duration::from_millis(40);
/// The longest message of a page.
const MOST_MESSAGE: usize = 64;

/// A handle to the threads that serve. They end when it is dropped.
pub(super) struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    hub: Arc<Hub>,
    timeouts: Timeouts,
    open: AtomicUsize,
    /// The open streams by the numbers of their connections, to be shut down with the server.
    streams: Mutex<Vec<(u64, TcpStream)>>,
}

/// The timeouts of a connection: of its request, and of a stream.
struct Timeouts {
    request: Duration,
    stream: Duration,
}

impl Server {
    pub(super) fn start(address: SocketAddr, hub: Arc<Hub>) -> io::Result<Self> {
        Self::start_with(address, hub, Timeouts { request: REQUEST_TIMEOUT, stream: STREAM_TIMEOUT })
    }

    fn start_with(address: SocketAddr, hub: Arc<Hub>, timeouts: Timeouts) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared { hub, timeouts, open: AtomicUsize::new(0), streams: Mutex::default() });
        let server = Self { address, shared: Arc::clone(&shared) };
        std::thread::Builder::new().name("dcd-view".into()).spawn(move || shared.listen(&listener))?;
        Ok(server)
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.hub.close();
        for (_, stream) in self.shared.streams().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
        // Wakes the thread that listens.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_millis(100));
    }
}

impl Shared {
    fn streams(&self) -> std::sync::MutexGuard<'_, Vec<(u64, TcpStream)>> {
        self.streams.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn listen(self: Arc<Self>, listener: &TcpListener) {
        for (number, stream) in (1..).zip(listener.incoming()) {
            if self.hub.is_closed() {
                return;
            }
            let Ok(stream) = stream else {
                // Perhaps the process is out of descriptors: some come back as other connections close.
                std::thread::sleep(Duration::from_millis(50));
                continue;
            };
            if self.open.fetch_add(1, Ordering::SeqCst) >= MOST_CONNECTIONS {
                self.open.fetch_sub(1, Ordering::SeqCst);
                continue;
            }
            let shared = Arc::clone(&self);
            let serve = move || {
                give_way();
                // A browser that goes away is no error.
                let _ = shared.serve(number, stream);
                shared.open.fetch_sub(1, Ordering::SeqCst);
            };
            if std::thread::Builder::new().name("dcd-view-page".into()).spawn(serve).is_err() {
                self.open.fetch_sub(1, Ordering::SeqCst);
            }
        }
    }

    fn serve(&self, number: u64, stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        let timely = || Timely::within(self.timeouts.request, &stream);
        let request = http::read(&mut timely(), &self.hub.key)?;
        match request {
            Err(refused) => http::write_refusal(&mut timely(), &refused),
            Ok(Request::File(path)) => match page::file(&path) {
                Some((kind, content)) => http::write_file(&mut timely(), kind, content),
                None => {
                    http::write_refusal(&mut timely(), &Refused("404 Not Found", "there is no such file"))
                }
            },
            Ok(Request::Stream { accept, rest }) => {
                if !self.hub.enter(number) {
                    let full = Refused("503 Service Unavailable", "too many pages look on; close another");
                    return http::write_refusal(&mut timely(), &full);
                }
                let done = self.stream(number, stream, &accept, rest);
                self.streams().retain(|(other, _)| *other != number);
                self.hub.leave(number);
                done
            }
        }
    }

    fn stream(&self, number: u64, mut stream: TcpStream, accept: &str, rest: Vec<u8>) -> io::Result<()> {
        http::write_upgrade(&mut stream, accept)?;
        stream.set_read_timeout(Some(self.timeouts.stream))?;
        stream.set_write_timeout(Some(self.timeouts.stream))?;
        self.streams().push((number, stream.try_clone()?));
        let mut socket = WebSocket::from_partially_read(stream, rest, Role::Server, Some(websocket()));
        let mut progress = Progress::default();
        while let Some(message) = self.hear(&mut socket) {
            let Some(request) = Asked::parse(&message) else { break };
            if let Asked::Choose(_) = request {
                progress.forget_chosen();
            }
            let Some(want) = obey(&self.hub, number, request) else { continue };
            // Each message is a WebSocket message of its own; all messages of an answer are flushed together.
            for bytes in self.hub.answer(number, &mut progress, want, NEWS) {
                if socket.write(Message::Binary(bytes)).is_err() {
                    return Ok(());
                }
            }
            if socket.flush().is_err() {
                break;
            }
        }
        Ok(())
    }

    /// Waits for the next message of a page; `None` once the page is gone. A page in a background tab draws
    /// nothing and so asks for nothing, but its browser answers pings.
    fn hear(&self, socket: &mut WebSocket<TcpStream>) -> Option<Bytes> {
        let mut is_asked = false;
        while !self.hub.is_closed() {
            match socket.read() {
                Ok(Message::Binary(message)) => return Some(message),
                Ok(_) => is_asked = false,
                Err(Error::Io(error)) if is_late(&error) && !is_asked => {
                    socket.send(Message::Ping(Bytes::new())).ok()?;
                    is_asked = true;
                }
                Err(_) => return None,
            }
        }
        None
    }
}

/// Returns the settings of a stream: the messages of a page are short.
fn websocket() -> WebSocketConfig {
    WebSocketConfig::default()
        .max_message_size(Some(MOST_MESSAGE))
        .max_frame_size(Some(MOST_MESSAGE))
        .read_buffer_size(4 << 10)
}

/// Carries out what a page asks. Returns what the page wants to see, if it waits for an answer.
fn obey(hub: &Hub, viewer: u64, asked: Asked) -> Option<Want> {
    match asked {
        Asked::See(want) => return Some(want),
        Asked::Pause(paused) => hub.control_by_page(|control| control.pause(paused)),
        Asked::Step(count) => hub.control_by_page(|control| control.step(count)),
        Asked::Speed(speed) => hub.control_by_page(|control| control.set_speed(speed)),
        Asked::Contacts(contacts) => hub.wish(viewer, |wishes| wishes.contacts = contacts),
        Asked::Go(tick) => hub.go(tick),
        Asked::Choose(body) => hub.wish(viewer, |wishes| wishes.chosen = Vec::from_iter(body)),
    }
    None
}

/// Reads `bytes` as all that a browser sends over one connection to a viewer whose key is `key`: the head of
/// a request and, after that of a stream, its messages. Returns how many messages were obeyed. For tests, as
/// anybody who finds the port may send any bytes.
#[doc(hidden)]
pub fn read_browser(bytes: &[u8]) -> usize {
    /// The bytes that a browser sends; answers are dropped.
    struct Said<'a>(&'a [u8]);

    impl Read for Said<'_> {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            self.0.read(into)
        }
    }

    impl Write for Said<'_> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    const VIEWER: u64 = 1;
    let hub = Hub::new("key".to_owned());
    hub.give_controls();
    let mut said = Said(bytes);
    let rest = match http::read(&mut said, &hub.key) {
        Ok(Ok(Request::Stream { rest, .. })) if hub.enter(VIEWER) => rest,
        Ok(Ok(Request::File(path))) => {
            page::file(&path);
            return 0;
        }
        _ => return 0,
    };
    let mut socket = WebSocket::from_partially_read(said, rest, Role::Server, Some(websocket()));
    let (mut progress, mut obeyed) = (Progress::default(), 0);
    while let Ok(message) = socket.read() {
        let Message::Binary(message) = message else { continue };
        let Some(asked) = Asked::parse(&message) else { break };
        obeyed += 1;
        let answered =
            obey(&hub, VIEWER, asked).map(|want| hub.answer(VIEWER, &mut progress, want, Duration::ZERO));
        let _ = (answered, hub.wishes(), hub.wait_for_step(1.0 / 60.0, Duration::ZERO));
    }
    hub.leave(VIEWER);
    obeyed
}

/// Returns whether a read timed out, for which systems have two names.
fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
}

/// A request of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Asked {
    See(Want),
    Pause(bool),
    Step(u32),
    Speed(f32),
    Contacts(bool),
    /// Sends the details of a body, or of none.
    Choose(Option<BodyId>),
    /// Goes to a tick of a recording.
    Go(u64),
}

impl Asked {
    /// Parses a message of a page: a byte for its kind, and a number of eight bytes.
    fn parse(message: &[u8]) -> Option<Self> {
        let (&kind, number) = message.split_first()?;
        let number = <[u8; 8]>::try_from(number).ok()?;
        let (bits, real) = (u64::from_le_bytes(number), f64::from_le_bytes(number));
        Some(match kind {
            1 => Self::See(Want::Newest),
            2 => Self::See(Want::Past(bits)),
            3 => Self::Pause(bits != 0),
            4 => Self::Step(bits.min(u32::MAX.into()) as u32),
            5 => Self::Speed(real as f32),
            6 => Self::Contacts(bits != 0),
            7 => Self::Choose(Some(BodyId::from_bits(bits))),
            8 => Self::Choose(None),
            9 => Self::Go(bits),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    /// Longer than anything here takes, even on a busy machine.
    const LIMIT: Duration = Duration::from_secs(30);

    fn server(address: &str, timeouts: Timeouts) -> Server {
        let hub = Arc::new(Hub::new("secret".to_owned()));
        Server::start_with(address.parse().unwrap(), hub, timeouts).unwrap()
    }

    fn connect(server: &Server) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", server.address().port())).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        stream
    }

    /// Opens a stream as a page that was reached by this host name does; returns the status if the stream is
    /// refused.
    fn open(server: &Server, host: &str) -> Result<WebSocket<TcpStream>, String> {
        let mut stream = connect(server);
        write!(
            stream,
            "GET /stream?key=secret HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\n\
             Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        )
        .unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        let status = String::from_utf8_lossy(&head[9..12]).into_owned();
        if status == "101" { Ok(WebSocket::from_raw_socket(stream, Role::Client, None)) } else { Err(status) }
    }

    #[test]
    fn a_page_that_asks_nothing_is_kept_as_long_as_its_browser_is_there() {
        let started = |stream| server("127.0.0.1:0", Timeouts { request: REQUEST_TIMEOUT, stream });
        // Long enough for an answer, on a busy machine, too.
        let patient = started(Duration::from_secs(1));
        let mut hidden = open(&patient, "127.0.0.1:0").unwrap();
        // Reading answers pings, as a browser does.
        for _ in 0..2 {
            assert_eq!(hidden.read().unwrap(), Message::Ping(Bytes::new()));
        }
        hidden.send(Message::binary([&[1][..], &[0; 8]].concat())).unwrap();
        while !hidden.read().unwrap().is_binary() {}
        let impatient = started(Duration::from_millis(50));
        let mut gone = open(&impatient, "127.0.0.1:0").unwrap();
        let raw = gone.get_mut();
        assert!(raw.read_to_end(&mut Vec::new()).is_ok(), "who answers no ping is let go");
    }

    #[test]
    fn a_viewer_that_listens_on_every_address_is_reached_as_localhost() {
        let server = server("0.0.0.0:0", Timeouts { request: REQUEST_TIMEOUT, stream: STREAM_TIMEOUT });
        assert!(open(&server, "localhost:8080").is_ok());
        assert_eq!(open(&server, "rebound.example:8080").err().as_deref(), Some("421"));
    }

    #[test]
    fn a_request_must_have_come_in_time_however_few_bytes_come_at_once() {
        let request = Duration::from_millis(300);
        let server = server("127.0.0.1:0", Timeouts { request, stream: STREAM_TIMEOUT });
        let mut slow = connect(&server);
        let start = Instant::now();
        // Each byte comes well in time. The reads in between wait a while for an answer, and tell when the
        // stream ends.
        slow.set_read_timeout(Some(request / 10)).unwrap();
        let ends = |slow: &mut TcpStream| match slow.read(&mut [0]) {
            Ok(_) => true,
            Err(error) => !is_late(&error),
        };
        while slow.write_all(b"G").is_ok() && !ends(&mut slow) {
            assert!(start.elapsed() < LIMIT, "it is still read");
        }
    }

    #[test]
    fn messages_that_are_none_are_not_obeyed() {
        let of = |kind: u8, number: [u8; 8]| Asked::parse(&[&[kind][..], &number].concat());
        assert_eq!(of(2, 9u64.to_le_bytes()), Some(Asked::See(Want::Past(9))));
        assert_eq!(of(5, 0.5f64.to_le_bytes()), Some(Asked::Speed(0.5)));
        assert_eq!(of(4, u64::MAX.to_le_bytes()), Some(Asked::Step(u32::MAX)));
        assert_eq!((of(0, [0; 8]), of(10, [0; 8])), (None, None));
        assert_eq!((Asked::parse(&[]), Asked::parse(&[1]), Asked::parse(&[1; 10])), (None, None, None));
    }
}
