//! Opens WebSockets to servers of this machine.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use tungstenite::WebSocket;
use tungstenite::protocol::{Role, WebSocketConfig};

/// A limit that nothing here comes near, even on a busy machine.
const LIMIT: Duration = Duration::from_secs(30);

/// Sends the head of a request. Returns the stream, the head of the answer, and the bytes that came after it.
pub fn request(address: &str, head: &str) -> io::Result<(TcpStream, String, Vec<u8>)> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(LIMIT))?;
    stream.set_write_timeout(Some(LIMIT))?;
    stream.write_all(head.as_bytes())?;
    let mut answer = Vec::new();
    loop {
        if let Some(end) = answer.windows(4).position(|four| four == b"\r\n\r\n") {
            let rest = answer.split_off(end + 4);
            return Ok((stream, String::from_utf8_lossy(&answer).into_owned(), rest));
        }
        let mut part = [0; 4096];
        match stream.read(&mut part)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            count => answer.extend(&part[..count]),
        }
    }
}

/// Opens a WebSocket with this origin, as a page does, or without one, as a program does. Returns the
/// server's answer if it refuses.
pub fn open(
    address: &str,
    path: &str,
    host: &str,
    origin: Option<&str>,
) -> Result<WebSocket<TcpStream>, String> {
    let origin = origin.map(|origin| format!("Origin: {origin}\r\n")).unwrap_or_default();
    let head = format!(
        "GET {path} HTTP/1.1\r\nHost: {host}\r\n{origin}Upgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    );
    let (stream, answer, rest) = request(address, &head).map_err(|error| error.to_string())?;
    if !answer.starts_with("HTTP/1.1 101 ") {
        return Err(answer);
    }
    let config = WebSocketConfig::default().max_frame_size(None).max_message_size(None);
    Ok(WebSocket::from_partially_read(stream, rest, Role::Client, Some(config)))
}
