//! Reads requests of browsers, checks that they come from the viewer's own page, and writes answers.

use std::io::{self, Read, Write};
use std::net::IpAddr;

use ring::digest::{SHA1_FOR_LEGACY_USE_ONLY, digest};

use crate::http::{read_head, write_answer};

/// A request for a page, or for the stream of pictures.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// A file of the page.
    File(String),
    /// The stream of pictures. `accept` is the answer to the WebSocket's key, `rest` are bytes that came
    /// after the head of the request.
    Stream { accept: String, rest: Vec<u8> },
}

/// The reason why a request is refused: its status, and a text for people.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Refused(pub(super) &'static str, pub(super) &'static str);

const MALFORMED: Refused = Refused("400 Bad Request", "this is no request of a browser");

/// Reads the head of a request, and decides what it is for. `key` is the viewer's secret, without which the
/// stream is refused.
pub(super) fn read(from: &mut impl Read, key: &str) -> io::Result<Result<Request, Refused>> {
    let judged = read_head(from, |request, rest| judge(request, rest, key))?;
    Ok(judged.unwrap_or(Err(MALFORMED)))
}

fn judge(request: &httparse::Request<'_, '_>, rest: &[u8], key: &str) -> Result<Request, Refused> {
    let header = |name: &str| {
        let found = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
        found.and_then(|header| std::str::from_utf8(header.value).ok()).map(str::trim)
    };
    let (Some("GET"), Some(path), Some(host)) = (request.method, request.path, header("host")) else {
        return Err(MALFORMED);
    };
    if !is_ours(host) {
        // DNS rebinding: another site may let its own name resolve to this address, and its page would then
        // be of the same origin.
        return Err(Refused("421 Misdirected Request", "open the viewer by the address that it printed"));
    }
    let (file, query) = path.split_once('?').unwrap_or((path, ""));
    if file != "/stream" {
        return Ok(Request::File(file.to_owned()));
    }
    let is_own_page = header("origin").is_none_or(|origin| origin.strip_prefix("http://") == Some(host));
    let has_key = query.split('&').any(|part| part.strip_prefix("key=") == Some(key));
    if !is_own_page {
        return Err(Refused("403 Forbidden", "only the viewer's own page may read the stream"));
    }
    if !has_key {
        return Err(Refused(
            "403 Forbidden",
            "the key is not this viewer's: open the address that it printed",
        ));
    }
    let asks = |name, what: &str| {
        header(name).is_some_and(|value| value.split(',').any(|v| v.trim().eq_ignore_ascii_case(what)))
    };
    match header("sec-websocket-key") {
        Some(nonce) if asks("upgrade", "websocket") && asks("sec-websocket-version", "13") => {
            Ok(Request::Stream { accept: accept(nonce), rest: rest.to_vec() })
        }
        _ => Err(Refused("426 Upgrade Required", "the stream is a WebSocket, version 13")),
    }
}

/// Returns whether a request with this `Host` is meant for this viewer: the host is an IP address or
/// `localhost`. The port and the address where the viewer listens do not matter: a tunnel has a port of its
/// own, and browsers resolve `localhost` only to their own machine. Any other name is refused, as it may by
/// now resolve to this address.
fn is_ours(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if !port.ends_with(']') => name,
        _ => host,
    };
    let name = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok()
}

/// Returns the answer to the key of a WebSocket handshake (RFC 6455, 4.2.2).
fn accept(nonce: &str) -> String {
    const MAGIC: &str = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
    let hash = digest(&SHA1_FOR_LEGACY_USE_ONLY, format!("{nonce}{MAGIC}").as_bytes());
    data_encoding::BASE64.encode(hash.as_ref())
}

/// Writes a file of the page, with headers by which it may neither load anything from elsewhere nor be
/// framed.
pub(super) fn write_file(to: &mut impl Write, kind: &str, content: &[u8]) -> io::Result<()> {
    const HEADERS: &str = "Cache-Control: no-store\r\n\
         Content-Security-Policy: default-src 'self'; img-src data:; frame-ancestors 'none'\r\n\
         X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n";
    write_answer(to, "200 OK", kind, HEADERS, content)
}

pub(super) fn write_refusal(to: &mut impl Write, Refused(status, why): &Refused) -> io::Result<()> {
    write_answer(to, status, "text/plain", "", format!("{why}\n").as_bytes())
}

pub(super) fn write_upgrade(to: &mut impl Write, accept: &str) -> io::Result<()> {
    write!(
        to,
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(request: &str) -> Result<Request, Refused> {
        read(&mut request.as_bytes(), "secret").unwrap()
    }

    fn stream(host: &str, origin: &str, query: &str) -> Result<Request, Refused> {
        answer(&format!(
            "GET /stream?{query} HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\nrest"
        ))
    }

    #[test]
    fn the_stream_takes_the_key_the_host_and_the_page_of_this_viewer() {
        // The example of RFC 6455, 1.3.
        let accept = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=".to_owned();
        let good = stream("127.0.0.1:4000", "http://127.0.0.1:4000", "key=secret");
        assert_eq!(good, Ok(Request::Stream { accept, rest: b"rest".to_vec() }));
        assert!(stream("localhost:4000", "http://localhost:4000", "key=secret").is_ok());
        let refused = |host, origin, query| stream(host, origin, query).unwrap_err().0;
        assert_eq!(
            refused("rebound.example:4000", "http://rebound.example:4000", "key=secret"),
            "421 Misdirected Request"
        );
        assert!(stream("localhost:8080", "http://localhost:8080", "key=secret").is_ok(), "by a tunnel");
        assert_eq!(refused("localhost:4000", "http://localhost:9999", "key=secret"), "403 Forbidden");
        assert_eq!(refused("127.0.0.1:4000", "http://evil.example", "key=secret"), "403 Forbidden");
        assert_eq!(refused("127.0.0.1:4000", "null", "key=secret"), "403 Forbidden");
        assert_eq!(refused("127.0.0.1:4000", "http://127.0.0.1:4000", "key=other"), "403 Forbidden");
    }

    #[test]
    fn requests_that_are_none_are_refused() {
        assert_eq!(answer("POST / HTTP/1.1\r\nHost: 127.0.0.1:4000\r\n\r\n"), Err(MALFORMED));
        assert_eq!(answer("GET / HTTP/1.1\r\n\r\n"), Err(MALFORMED));
        assert_eq!(answer("\u{1}\r\n\r\n"), Err(MALFORMED));
        let long = format!("GET / HTTP/1.1\r\nHost: {}", "x".repeat(1 << 20));
        assert_eq!(answer(&long), Err(MALFORMED));
        let upgrade = answer("GET /stream?key=secret HTTP/1.1\r\nHost: 127.0.0.1:4000\r\n\r\n");
        assert_eq!(upgrade.unwrap_err().0, "426 Upgrade Required");
        assert_eq!(
            answer("GET /view.js?x HTTP/1.1\r\nHost: [::1]:4000\r\n\r\n"),
            Ok(Request::File("/view.js".into()))
        );
    }
}
