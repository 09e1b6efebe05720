//! Reads the heads of HTTP requests and writes short responses, for the viewer and the metrics endpoint.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// The longest head of a request, in bytes; below, the most headers.
const MOST_HEAD: usize = 16 << 10;
const MOST_HEADERS: usize = 64;

/// Reads the head of a request and returns what `judge` makes of it and of the bytes that follow it. Returns
/// `None` if the bytes are no HTTP request, or the head is too long.
pub(crate) fn read_head<T>(
    from: &mut impl Read,
    judge: impl FnOnce(&httparse::Request<'_, '_>, &[u8]) -> T,
) -> io::Result<Option<T>> {
    let mut head = Vec::new();
    loop {
        let mut part = [0; 2048];
        let count = from.read(&mut part)?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        head.extend(&part[..count]);
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(&head) {
            Ok(httparse::Status::Complete(length)) => return Ok(Some(judge(&request, &head[length..]))),
            Ok(httparse::Status::Partial) if head.len() < MOST_HEAD => {}
            _ => return Ok(None),
        }
    }
}

/// A stream with one deadline for all its reads and writes together, however few bytes each of them moves.
pub(crate) struct Timely<'a> {
    stream: &'a TcpStream,
    until: Instant,
}

impl<'a> Timely<'a> {
    pub(crate) fn within(timeout: Duration, stream: &'a TcpStream) -> Self {
        Self { stream, until: Instant::now() + timeout }
    }

    fn left(&self) -> io::Result<Duration> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(io::ErrorKind::TimedOut.into()) } else { Ok(left) }
    }
}

impl Read for Timely<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(Some(self.left()?))?;
        let mut stream = self.stream;
        stream.read(into)
    }
}

impl Write for Timely<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(Some(self.left()?))?;
        let mut stream = self.stream;
        stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes a whole response, after which the connection ends. Each line of `headers` ends with `\r\n`.
pub(crate) fn write_answer(
    to: &mut impl Write,
    status: &str,
    kind: &str,
    headers: &str,
    content: &[u8],
) -> io::Result<()> {
    let length = content.len();
    write!(
        to,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n{headers}\r\n"
    )?;
    to.write_all(content)
}
