//! Serves the page and the stream to browsers: a thread that listens, and one for each connection.

use std::io;
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use super::http::{self, Refused, Request};
use super::hub::{Hub, Progress, Want};
use super::page;
use crate::space::BodyId;

/// The most connections at a time; browsers open some for the files of the page.
const MOST_CONNECTIONS: usize = 64;
/// How long a request may take to come.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// How long a browser may take nothing of what it is sent, or ask for nothing, before it is let go.
const STREAM_TIMEOUT: Duration = Duration::from_secs(60);
/// How long an answer waits for a newer picture.
const NEWS: Duration = Duration::from_millis(40);
/// The longest message of a page.
const MOST_MESSAGE: usize = 64;

/// The threads that serve; dropping it ends them.
pub(super) struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    hub: Arc<Hub>,
    here: SocketAddr,
    open: AtomicUsize,
    /// The streams, to be ended when the server is.
    streams: Mutex<Vec<(u64, TcpStream)>>,
}

impl Server {
    pub(super) fn start(address: SocketAddr, hub: Arc<Hub>) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let here = listener.local_addr()?;
        let shared = Arc::new(Shared { hub, here, open: AtomicUsize::new(0), streams: Mutex::default() });
        let server = Self { address: here, shared: Arc::clone(&shared) };
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
            let Ok(stream) = stream else { continue };
            if self.open.fetch_add(1, Ordering::SeqCst) >= MOST_CONNECTIONS {
                self.open.fetch_sub(1, Ordering::SeqCst);
                continue;
            }
            let shared = Arc::clone(&self);
            let serve = move || {
                // A browser that goes away is no error.
                let _ = shared.serve(number, stream);
                shared.open.fetch_sub(1, Ordering::SeqCst);
            };
            if std::thread::Builder::new().name("dcd-view-page".into()).spawn(serve).is_err() {
                self.open.fetch_sub(1, Ordering::SeqCst);
            }
        }
    }

    fn serve(&self, number: u64, mut stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(REQUEST_TIMEOUT))?;
        stream.set_write_timeout(Some(REQUEST_TIMEOUT))?;
        let request = http::read(&mut stream, self.here, &self.hub.key)?;
        match request {
            Err(refused) => http::write_refusal(&mut stream, &refused),
            Ok(Request::File(path)) => match page::file(&path) {
                Some((kind, content)) => http::write_file(&mut stream, kind, content),
                None => http::write_refusal(&mut stream, &Refused("404 Not Found", "there is no such file")),
            },
            Ok(Request::Stream { accept, rest }) => {
                if !self.hub.enter(number) {
                    let full = Refused("503 Service Unavailable", "too many pages look on; close another");
                    return http::write_refusal(&mut stream, &full);
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
        stream.set_read_timeout(Some(STREAM_TIMEOUT))?;
        stream.set_write_timeout(Some(STREAM_TIMEOUT))?;
        self.streams().push((number, stream.try_clone()?));
        let config = WebSocketConfig::default()
            .max_message_size(Some(MOST_MESSAGE))
            .max_frame_size(Some(MOST_MESSAGE))
            .read_buffer_size(4 << 10);
        let mut socket = WebSocket::from_partially_read(stream, rest, Role::Server, Some(config));
        let mut progress = Progress::default();
        while !self.hub.is_closed() {
            let message = match socket.read() {
                Ok(Message::Binary(message)) => message,
                Ok(Message::Close(_)) => continue,
                Ok(_) => continue,
                Err(_) => break,
            };
            let Some(request) = Asked::parse(&message) else { break };
            let Some(want) = self.obey(number, request) else { continue };
            // In frames: what comes in one must fit together.
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

    /// Does what a page asks; returns what it wants to see, if it waits for an answer.
    fn obey(&self, viewer: u64, asked: Asked) -> Option<Want> {
        match asked {
            Asked::See(want) => return Some(want),
            Asked::Pause(paused) => self.hub.control(|control| control.pause(paused)),
            Asked::Step(count) => self.hub.control(|control| control.step(count)),
            Asked::Speed(speed) => self.hub.control(|control| control.set_speed(speed)),
            Asked::Contacts(contacts) => self.hub.wish(viewer, |wishes| wishes.contacts = contacts),
            Asked::Go(tick) => self.hub.go(tick),
            Asked::Choose(body) => self.hub.wish(viewer, |wishes| wishes.chosen = Vec::from_iter(body)),
        }
        None
    }
}

/// What a page asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Asked {
    See(Want),
    Pause(bool),
    Step(u32),
    Speed(f32),
    Contacts(bool),
    /// Tells more of a body.
    Choose(Option<BodyId>),
    /// Goes to a tick of a recording.
    Go(u64),
}

impl Asked {
    /// Reads a message of a page: a byte that says what it is, and a number of eight bytes.
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
    use super::*;

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
