//! Tells systemd the state of the process, by datagrams to the socket that `NOTIFY_SOCKET` names
//! (sd_notify(3), Type=notify): that it is ready, that it stops, what it does, and that it does not hang.

use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::time::Duration;

use self::socket::Socket;
use crate::runtime::Pulse;

/// The longest time between two reports of what the process does.
const STATUS: Duration = Duration::from_secs(5);
/// The least time after which a loop counts as hung: an idle loop turns twice per second.
const TURNS: Duration = Duration::from_secs(1);

/// The connection to systemd, if that started the process and asked for reports.
pub(super) struct Notifier {
    socket: Option<Socket>,
    /// The time after which systemd takes a silent process for hung.
    watchdog: Option<Duration>,
}

/// A handle to the thread that reports to systemd, which ends when the handle is dropped.
pub(super) struct Watch {
    _until: Sender<()>,
}

impl Notifier {
    pub(super) fn from_environment() -> Self {
        let watchdog = watchdog(|name| std::env::var(name).ok(), std::process::id());
        Self { socket: Socket::from_environment(), watchdog }
    }

    /// Says that the process is ready while it has no loop whose pulse can be watched.
    pub(super) fn ready(&self, words: &str) {
        self.say(&format!("READY=1\nSTATUS={words}"));
    }

    /// Says that the process is not ready yet, and waits for something that may take long.
    pub(super) fn waits(&self, words: &str) {
        self.say(&format!("EXTEND_TIMEOUT_USEC=300000000\nSTATUS={words}"));
    }

    /// Says that the process does not hang.
    pub(super) fn alive(&self) {
        if self.watchdog.is_some() {
            self.say("WATCHDOG=1");
        }
    }

    /// Says that the process stops by its user's wish or because its world is over.
    pub(super) fn stopping(&self) {
        self.say("STOPPING=1\nSTATUS=stopping");
    }

    /// Says that the process is ready. A thread of its own then reports what it does and, for as long as its
    /// loop turns, that it does not hang.
    pub(super) fn watch(&self, pulse: impl Fn() -> Pulse + Send + 'static) -> Watch {
        let (until, over) = mpsc::channel::<()>();
        if let Some(socket) = self.socket.clone() {
            let teller = Self { socket: Some(socket), watchdog: self.watchdog };
            std::thread::spawn(move || {
                teller.say("READY=1");
                loop {
                    teller.say(&teller.news(&pulse()));
                    match over.recv_timeout(teller.period()) {
                        Err(RecvTimeoutError::Timeout) => {}
                        _ => return,
                    }
                }
            });
        }
        Watch { _until: until }
    }

    /// Returns the next report.
    fn news(&self, pulse: &Pulse) -> String {
        let mut news = format!("STATUS={}", pulse.words);
        let turns = |watchdog: Duration| pulse.turned.elapsed() < (watchdog / 2).max(TURNS);
        if self.watchdog.is_some_and(turns) {
            news.push_str("\nWATCHDOG=1");
        }
        news
    }

    fn period(&self) -> Duration {
        self.watchdog.map_or(STATUS, |watchdog| STATUS.min(watchdog / 2))
    }

    fn say(&self, news: &str) {
        self.socket.iter().for_each(|socket| socket.send(news));
    }
}

/// Returns how long this process may be silent, if the variables are meant for it and not for its parent.
fn watchdog(variable: impl Fn(&str) -> Option<String>, own_id: u32) -> Option<Duration> {
    let is_own = variable("WATCHDOG_PID").is_none_or(|id| id.parse() == Ok(own_id));
    let us = variable("WATCHDOG_USEC").filter(|_| is_own)?.parse().ok()?;
    (us > 0).then(|| Duration::from_micros(us))
}

#[cfg(unix)]
mod socket {
    use std::os::unix::net::UnixDatagram;
    use std::sync::Arc;

    /// A connected socket. A report that it cannot take at once is dropped: systemd hears the next one.
    #[derive(Clone)]
    pub(super) struct Socket(Arc<UnixDatagram>);

    impl Socket {
        pub(super) fn from_environment() -> Option<Self> {
            let place = std::env::var("NOTIFY_SOCKET").ok()?;
            let socket = UnixDatagram::unbound().ok()?;
            match place.strip_prefix('@') {
                Some(name) => connect_abstract(&socket, name)?,
                None => socket.connect(&place).ok()?,
            }
            socket.set_nonblocking(true).ok()?;
            Some(Self(Arc::new(socket)))
        }

        pub(super) fn send(&self, text: &str) {
            let _ = self.0.send(text.as_bytes());
        }
    }

    #[cfg(target_os = "linux")]
    fn connect_abstract(socket: &UnixDatagram, name: &str) -> Option<()> {
        use std::os::linux::net::SocketAddrExt;
        let place = std::os::unix::net::SocketAddr::from_abstract_name(name).ok()?;
        socket.connect_addr(&place).ok()
    }

    #[cfg(not(target_os = "linux"))]
    fn connect_abstract(_: &UnixDatagram, _: &str) -> Option<()> {
        None
    }
}

#[cfg(not(unix))]
mod socket {
    /// No system but Linux has systemd.
    #[derive(Clone)]
    pub(super) struct Socket(std::convert::Infallible);

    impl Socket {
        pub(super) fn from_environment() -> Option<Self> {
            None
        }

        pub(super) fn send(&self, _: &str) {
            match self.0 {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    #[test]
    fn a_loop_that_hangs_is_not_told_to_be_alive() {
        let notifier = Notifier { socket: None, watchdog: Some(Duration::from_secs(10)) };
        let turned = |ago_s| Instant::now().checked_sub(Duration::from_secs(ago_s)).unwrap();
        let told = |ago_s| notifier.news(&Pulse { turned: turned(ago_s), words: "tick 5".to_owned() });
        assert_eq!(told(0), "STATUS=tick 5\nWATCHDOG=1");
        assert_eq!(told(6), "STATUS=tick 5");
    }

    #[test]
    fn a_watchdog_is_that_of_the_process_it_is_meant_for() {
        let of = |id: Option<&str>, us: Option<&str>| {
            let (id, us) = (id.map(str::to_owned), us.map(str::to_owned));
            watchdog(|name| if name == "WATCHDOG_PID" { id.clone() } else { us.clone() }, 7)
        };
        assert_eq!(of(None, Some("1500000")), Some(Duration::from_millis(1500)));
        assert_eq!(of(Some("7"), Some("1")), Some(Duration::from_micros(1)));
        assert_eq!(of(Some("8"), Some("1")), None);
        assert_eq!((of(None, None), of(None, Some("0")), of(None, Some("x"))), (None, None, None));
    }
}
