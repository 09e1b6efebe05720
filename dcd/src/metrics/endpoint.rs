//! Serves `/metrics`, `/healthz` and `/readyz`, with one thread that listens and one thread per connection.

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::http::{Timely, read_head, write_answer};

/// The most connections at a time. Each is for one request.
const MOST_CONNECTIONS: usize = 16;
/// The longest time for a request to arrive, and for its answer to be read.
const TIMEOUT: Duration = Duration::from_secs(5);
/// The content type of Prometheus' text format.
const METRICS: &str = "text/plain; version=0.0.4; charset=utf-8";
const PLAIN: &str = "text/plain; charset=utf-8";

/// A process that others ask about its state. It answers from numbers that it has written down, so that
/// nobody waits for it.
pub(crate) trait Source: Send + Sync + 'static {
    /// Returns all metrics, in Prometheus' text format.
    fn metrics(&self) -> String;

    /// Returns an error with the reason if the process should be restarted.
    fn healthy(&self) -> Result<(), String>;

    /// Returns an error with the reason if the process does not do its part now.
    fn ready(&self) -> Result<(), String>;
}

/// The threads that answer requests. Dropping it ends them and frees the address.
#[derive(Debug)]
pub(crate) struct Endpoint {
    address: SocketAddr,
    is_closed: Arc<AtomicBool>,
    listens: Option<JoinHandle<()>>,
}

impl Endpoint {
    /// Starts to listen at an address; port 0 takes any free port.
    pub(crate) fn start(address: SocketAddr, source: Arc<dyn Source>) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let (address, is_closed) = (listener.local_addr()?, Arc::new(AtomicBool::new(false)));
        let until = Arc::clone(&is_closed);
        let listen = move || listen(&listener, &until, &source);
        let listens = std::thread::Builder::new().name("dcd-metrics".into()).spawn(listen)?;
        Ok(Self { address, is_closed, listens: Some(listens) })
    }

    /// Returns the address that it listens on.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        self.is_closed.store(true, Ordering::SeqCst);
        // Wakes the listening thread. If it cannot be woken, it is not waited for.
        let woken = TcpStream::connect_timeout(&self.address, Duration::from_millis(100));
        if let (Ok(_), Some(listens)) = (woken, self.listens.take()) {
            let _ = listens.join();
        }
    }
}

fn listen(listener: &TcpListener, is_closed: &AtomicBool, source: &Arc<dyn Source>) {
    let open = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        if is_closed.load(Ordering::SeqCst) {
            return;
        }
        let Ok(stream) = stream else {
            // Perhaps no descriptors are left. They come back as others close theirs.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        if open.fetch_add(1, Ordering::SeqCst) >= MOST_CONNECTIONS {
            open.fetch_sub(1, Ordering::SeqCst);
            continue;
        }
        let (source, place) = (Arc::clone(source), Place(Arc::clone(&open)));
        let serve = move || {
            let _place = place;
            // A client that goes away before the answer is no error.
            let _ = serve(stream, &*source);
        };
        // If no thread can be started, dropping the closure frees the place.
        let _ = std::thread::Builder::new().name("dcd-metrics-answer".into()).spawn(serve);
    }
}

/// A place for one connection, which dropping it frees.
struct Place(Arc<AtomicUsize>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

fn serve(stream: TcpStream, source: &dyn Source) -> io::Result<()> {
    let mut request = Timely::within(TIMEOUT, &stream);
    let (status, kind, content) =
        read_head(&mut request, |request, _| answer(request.method, request.path, source))?.unwrap_or((
            "400 Bad Request",
            PLAIN,
            "this is no request of HTTP\n".to_owned(),
        ));
    let mut to = Timely::within(TIMEOUT, &stream);
    write_answer(&mut to, status, kind, "Cache-Control: no-store\r\n", content.as_bytes())
}

fn answer(
    method: Option<&str>,
    path: Option<&str>,
    source: &dyn Source,
) -> (&'static str, &'static str, String) {
    let state = |state: Result<(), String>| match state {
        Ok(()) => ("200 OK", PLAIN, "ok\n".to_owned()),
        Err(why) => ("503 Service Unavailable", PLAIN, format!("{why}\n")),
    };
    let path = path.map(|path| path.split('?').next().unwrap_or(path));
    match (method, path) {
        (Some("GET"), Some("/metrics")) => ("200 OK", METRICS, source.metrics()),
        (Some("GET"), Some("/healthz")) => state(source.healthy()),
        (Some("GET"), Some("/readyz")) => state(source.ready()),
        (Some("GET"), _) => ("404 Not Found", PLAIN, "ask for /metrics, /healthz or /readyz\n".to_owned()),
        _ => ("405 Method Not Allowed", PLAIN, "only GET is answered\n".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use super::*;

    struct Late;

    impl Source for Late {
        fn metrics(&self) -> String {
            "dcd_bodies 3\n".to_owned()
        }

        fn healthy(&self) -> Result<(), String> {
            Ok(())
        }

        fn ready(&self) -> Result<(), String> {
            Err("no tick yet".to_owned())
        }
    }

    fn ask(address: SocketAddr, request: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn each_path_is_answered_with_its_own_status() {
        let endpoint = Endpoint::start("127.0.0.1:0".parse().unwrap(), Arc::new(Late)).unwrap();
        let get = |path: &str| ask(endpoint.address(), &format!("GET {path} HTTP/1.1\r\nHost: x\r\n\r\n"));
        let metrics = get("/metrics");
        assert!(metrics.starts_with("HTTP/1.1 200 OK\r\n"), "{metrics}");
        assert!(
            metrics.contains("text/plain; version=0.0.4") && metrics.ends_with("\r\n\r\ndcd_bodies 3\n"),
            "{metrics}"
        );
        assert!(get("/healthz").ends_with("\r\n\r\nok\n"));
        let ready = get("/readyz?now");
        assert!(ready.starts_with("HTTP/1.1 503 ") && ready.ends_with("\r\n\r\nno tick yet\n"), "{ready}");
        assert!(get("/").starts_with("HTTP/1.1 404 "));
        assert!(ask(endpoint.address(), "POST /metrics HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 405 "));
        assert!(ask(endpoint.address(), "\u{1}\r\n\r\n").starts_with("HTTP/1.1 400 "));
    }

    #[test]
    fn who_sends_nothing_keeps_others_from_nothing_until_there_are_too_many() {
        let endpoint = Endpoint::start("127.0.0.1:0".parse().unwrap(), Arc::new(Late)).unwrap();
        let _idle: Vec<_> =
            (1..MOST_CONNECTIONS).map(|_| TcpStream::connect(endpoint.address()).unwrap()).collect();
        assert!(ask(endpoint.address(), "GET /healthz HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 200 "));
    }

    #[test]
    fn an_endpoint_that_is_dropped_listens_no_more() {
        let endpoint = Endpoint::start("127.0.0.1:0".parse().unwrap(), Arc::new(Late)).unwrap();
        let address = endpoint.address();
        drop(endpoint);
        Endpoint::start(address, Arc::new(Late)).unwrap();
    }
}
