//! Asks the members of an etcd cluster over its JSON gateway (`/v3/kv/...`), one after the other until one
//! answers.
//!
//! There bytes are written in base64, and 64-bit numbers as strings
//! (<https://etcd.io/docs/v3.4/dev-guide/api_grpc_gateway/>).

use std::sync::Arc;
use std::time::{Duration, Instant};

use data_encoding::BASE64;
use serde_json::{Value, json};

use super::address::EtcdAddress;
use super::login::Login;
use super::tls;
use crate::cluster::directory::DirectoryError;

/// How long one member may take to answer about a hold: a member that hangs is skipped before the hold runs
/// out. Where no member answers in this time, as on a slow disk, all get twice as long, and once more.
const ANSWER: Duration = Duration::from_millis(450);
/// The same for requests that read or write much.
const BULK_ANSWER: Duration = Duration::from_millis(1_500);
/// The same for a login, since etcd hashes passwords slowly, so that they cannot be guessed. Standby servers
/// wait for longer than this.
const LOG_IN: Duration = Duration::from_millis(1_000);
/// The same for making a connection.
const CONNECT: Duration = Duration::from_millis(250);
/// The most doublings of the time in which a member must answer.
const DOUBLED: u32 = 2;
/// The most bytes of an answer: more than a page of values in base64.
const ANSWER_BYTES: u64 = 64 << 20;
/// The most characters that are shown of an answer that is not JSON.
const TEXT_CHARS: usize = 200;
/// The most values in an answer.
const PAGE: usize = 8;

/// A client of an etcd cluster. Clones share connections and the login.
#[derive(Clone, Debug)]
pub(super) struct Gateway {
    agent: ureq::Agent,
    scheme: &'static str,
    members: Vec<String>,
    login: Option<Arc<Login>>,
    /// The index of the member that answered last.
    current: usize,
    /// The time in which a member must answer, if one did so the last time.
    answer: Duration,
    /// The number of doublings of that time that hold now.
    doubled: u32,
}

/// The reason why etcd has not done what it was asked.
#[derive(Debug)]
pub(super) enum GatewayError {
    /// No member answers, or the cluster has no leader now: ask again.
    Away(String),
    /// etcd has no room left, and takes no writes until somebody makes some.
    Full(String),
    /// etcd refuses the request.
    Refused(String),
    /// etcd does not know this client, and has not done it. It takes the request from a client that logs in.
    Unknown(String),
}

/// A write to etcd.
#[derive(Clone, Debug)]
pub(super) enum Op {
    Put(Vec<u8>, Vec<u8>),
    /// Deletes all keys from the first on, before the second.
    Delete(Vec<u8>, Vec<u8>),
}

/// A condition of a transaction.
#[derive(Clone, Debug)]
pub(super) enum Compare {
    /// The key was created at this revision of etcd; 0: there is no such key.
    Created(Vec<u8>, i64),
    /// The key was last written at this revision.
    Written(Vec<u8>, i64),
    /// The key has this value; `None`: there is no such key.
    Is(Vec<u8>, Option<Vec<u8>>),
}

/// The first keys of a range.
#[derive(Debug)]
pub(super) struct Page {
    pub(super) found: Vec<Found>,
    /// Says whether there are more keys after these.
    pub(super) more: bool,
}

/// A key with its value.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) key: Vec<u8>,
    pub(super) value: Vec<u8>,
    /// The revisions of etcd at which the key was created and last written.
    pub(super) created: i64,
    pub(super) written: i64,
}

impl Gateway {
    /// Makes a gateway, and reads the files of credentials. An error names the file.
    pub(super) fn new(address: &EtcdAddress) -> Result<Self, DirectoryError> {
        let place = address.to_string();
        let mut config = ureq::Agent::config_builder()
            .timeout_connect(Some(CONNECT))
            .http_status_as_error(false)
            // No member of etcd redirects. A redirect would lead to a host that the user did not name.
            .max_redirects(0)
            .proxy(None);
        if let Some(files) = &address.tls {
            // This time includes the TLS handshake.
            config = config.timeout_connect(Some(2 * CONNECT)).tls_config(tls::config(files, &place)?);
        }
        let login = address.user.clone().map(Login::new);
        if let Some(login) = &login {
            login.request().map_err(|cause| tls::unusable(login.place(), "the password", &place, cause))?;
        }
        Ok(Self {
            agent: config.build().into(),
            scheme: address.scheme(),
            members: address.members.clone(),
            login: login.map(Arc::new),
            current: 0,
            answer: ANSWER,
            doubled: 0,
        })
    }

    /// Returns a gateway for requests that read or write much.
    pub(super) fn for_bulk(mut self) -> Self {
        self.answer = BULK_ANSWER;
        self
    }

    /// Does all `ops` if all conditions hold; returns whether they hold.
    ///
    /// After an error it is unknown whether the transaction was done, or will be: a member that did not
    /// answer in time may do it later, after requests that follow. So whatever must not be done late needs a
    /// condition that does not hold any more then.
    pub(super) fn transact(&mut self, conditions: &[Compare], ops: &[Op]) -> Result<bool, GatewayError> {
        let compare: Vec<_> = conditions.iter().map(Compare::json).collect();
        let success: Vec<_> = ops.iter().map(Op::json).collect();
        let answer = self.ask("txn", &json!({ "compare": compare, "success": success }))?;
        Ok(answer["succeeded"].as_bool().unwrap_or(false))
    }

    /// Returns a key with its value, if there is such a key.
    pub(super) fn read(&mut self, key: &[u8]) -> Result<Option<Found>, GatewayError> {
        let answer = self.ask("range", &json!({ "key": BASE64.encode(key) }))?;
        Ok(found(&answer)?.pop())
    }

    /// Returns the first keys from one on, before another, in order.
    pub(super) fn read_page(&mut self, from: &[u8], to: &[u8]) -> Result<Page, GatewayError> {
        let (key, range_end) = (BASE64.encode(from), BASE64.encode(to));
        let answer = self.ask("range", &json!({ "key": key, "range_end": range_end, "limit": PAGE }))?;
        Ok(Page { found: found(&answer)?, more: answer["more"].as_bool().unwrap_or(false) })
    }

    /// Asks each member at most once, beginning with the one that answered last. An error says of each why it
    /// did not answer.
    fn ask(&mut self, what: &str, request: &Value) -> Result<Value, GatewayError> {
        let request = request.to_string();
        let mut why = Vec::new();
        for turn in 0..self.members.len() {
            let at = (self.current + turn) % self.members.len();
            let asked = Instant::now();
            match self.ask_member(&self.members[at], what, &request) {
                Err(GatewayError::Away(cause)) => why.push(format!("{}: {cause}", self.members[at])),
                answer => {
                    self.current = at;
                    if asked.elapsed() < self.answer {
                        self.doubled = 0;
                    }
                    return answer;
                }
            }
        }
        // The next call does not begin with the member that failed first in this one.
        self.current = (self.current + 1) % self.members.len();
        self.doubled = (self.doubled + 1).min(DOUBLED);
        Err(GatewayError::Away(why.join("; ")))
    }

    /// Returns how long one member may take to answer.
    fn patience(&self) -> Duration {
        self.answer * 2u32.pow(self.doubled)
    }

    /// Returns the token of the last login.
    #[cfg(test)]
    pub(super) fn token(&self) -> Option<String> {
        self.login.as_ref().and_then(|login| login.token())
    }

    /// Asks one member, and logs in first if etcd requires that.
    fn ask_member(&self, member: &str, what: &str, request: &str) -> Result<Value, GatewayError> {
        let path = format!("kv/{what}");
        let token = self.login.as_ref().and_then(|login| login.token());
        let answer = self.post(member, &path, request, token.as_deref(), self.patience());
        let Err(GatewayError::Unknown(cause)) = answer else { return answer };
        let Some(login) = &self.login else {
            return Err(GatewayError::Refused(format!(
                "{cause}; this etcd has users: name one behind the world, by user=NAME&password-file=FILE"
            )));
        };
        let token = match login.token() {
            // Another clone has just got this token.
            Some(newer) if Some(&newer) != token.as_ref() => newer,
            _ => self.log_in(member, login)?,
        };
        match self.post(member, &path, request, Some(&token), self.patience()) {
            Err(GatewayError::Unknown(cause)) => Err(GatewayError::Away(format!(
                "it does not know the token that etcd has just given: {cause}"
            ))),
            answer => answer,
        }
    }

    /// Exchanges the password for a token, and keeps the token.
    fn log_in(&self, member: &str, login: &Login) -> Result<String, GatewayError> {
        // A file that is being replaced just now will be there in a moment.
        let request =
            login.request().map_err(|cause| GatewayError::Away(format!("{}: {cause}", login.place())))?;
        let answer = match self.post(member, "auth/authenticate", &request, None, LOG_IN) {
            // Authentication has just been turned off.
            Err(GatewayError::Refused(cause)) if cause.contains("authentication is not enabled") => {
                return Err(GatewayError::Away(cause));
            }
            Err(GatewayError::Refused(cause) | GatewayError::Unknown(cause)) => {
                let described = login.described();
                let why = format!(
                    "{cause}: {described}; see to the user's name and its password (etcdctl user passwd)"
                );
                return Err(match login.is_refused(&cause) {
                    true => GatewayError::Away(why),
                    false => GatewayError::Refused(why),
                });
            }
            answer => answer?,
        };
        let token = answer["token"].as_str().ok_or_else(unread)?;
        login.set_token(token.to_owned());
        Ok(token.to_owned())
    }

    fn post(
        &self,
        member: &str,
        path: &str,
        request: &str,
        token: Option<&str>,
        limit: Duration,
    ) -> Result<Value, GatewayError> {
        let is_tls = self.scheme == "https";
        let away = |error: ureq::Error| GatewayError::Away(tls::explained(&error, is_tls));
        let mut asked = self.agent.post(format!("{}://{member}/v3/{path}", self.scheme));
        if let Some(token) = token {
            asked = asked.header("authorization", token);
        }
        let asked = asked.config().timeout_global(Some(limit)).build();
        let mut answer = asked.content_type("application/json").send(request).map_err(away)?;
        let status = answer.status().as_u16();
        let body = answer.body_mut().with_config().limit(ANSWER_BYTES).read_to_vec().map_err(away)?;
        let parsed: Result<Value, _> = serde_json::from_slice(&body);
        match (status, parsed) {
            (200, Ok(answer)) => Ok(answer),
            (200, Err(error)) => Err(GatewayError::Refused(format!("its answer is no JSON ({error})"))),
            (status, Ok(answer)) if answer["error"].is_string() => {
                Err(refusal(status, answer["error"].as_str().unwrap_or_default()))
            }
            (status, _) => {
                let text: String = String::from_utf8_lossy(&body).trim().chars().take(TEXT_CHARS).collect();
                Err(refusal(status, &format!("HTTP status {status} {text}")))
            }
        }
    }
}

/// What etcd says to a request without a token, and to one with a token from before a change of users.
const UNKNOWN: [&str; 2] = ["user name is empty", "revision of auth store is old"];

/// The remedy for an etcd that has no room left.
const MAKE_ROOM: &str = "compact and defragment etcd, or give it more room (--quota-backend-bytes), and then lift its alarm (etcdctl alarm disarm)";

fn refusal(status: u16, text: &str) -> GatewayError {
    let with = |remedy: &str| GatewayError::Refused(format!("{text}; {remedy}"));
    match status {
        _ if text.contains("space exceeded") => GatewayError::Full(format!("{text}: {MAKE_ROOM}")),
        // No leader, a change of leader, a time-out within the cluster, or too many requests.
        408 | 429 | 500 | 502..=504 => GatewayError::Away(text.to_owned()),
        401 => GatewayError::Unknown(text.to_owned()),
        403 => with(
            "its user needs a role for the keys of this world: etcdctl role grant-permission ROLE --prefix=true readwrite dcd/NAME/",
        ),
        _ if UNKNOWN.iter().any(|unknown| text.contains(unknown)) => GatewayError::Unknown(text.to_owned()),
        _ if text.contains("CommonName") => with(
            "where it has users, its gateway takes no certificate that has a common name: issue one without for cert (-subj /O=dcd-server)",
        ),
        _ => GatewayError::Refused(text.to_owned()),
    }
}

fn unread() -> GatewayError {
    GatewayError::Refused("its answer is not etcd's".to_owned())
}

impl Op {
    /// Returns the deletion of one key.
    pub(super) fn delete(key: &[u8]) -> Self {
        Self::Delete(key.to_vec(), [key, &[0]].concat())
    }

    fn json(&self) -> Value {
        match self {
            Self::Put(key, value) => {
                json!({ "request_put": { "key": BASE64.encode(key), "value": BASE64.encode(value) } })
            }
            Self::Delete(from, to) => {
                json!({ "request_delete_range": { "key": BASE64.encode(from), "range_end": BASE64.encode(to) } })
            }
        }
    }
}

impl Compare {
    fn json(&self) -> Value {
        match self {
            Self::Created(key, at) => {
                json!({ "key": BASE64.encode(key), "target": "CREATE", "create_revision": at.to_string() })
            }
            Self::Is(key, None) => Self::Created(key.clone(), 0).json(),
            Self::Is(key, Some(value)) => {
                json!({ "key": BASE64.encode(key), "target": "VALUE", "value": BASE64.encode(value) })
            }
            Self::Written(key, at) => {
                json!({ "key": BASE64.encode(key), "target": "MOD", "mod_revision": at.to_string() })
            }
        }
    }
}

/// Reads the keys of an answer. etcd leaves out fields that are 0 or empty.
fn found(answer: &Value) -> Result<Vec<Found>, GatewayError> {
    let bytes = |value: &Value| match value.as_str() {
        Some(text) => BASE64.decode(text.as_bytes()).map_err(|_| unread()),
        None => Ok(Vec::new()),
    };
    let number = |value: &Value| value.as_str().and_then(|text| text.parse().ok()).ok_or_else(unread);
    let keys = answer["kvs"].as_array().into_iter().flatten();
    keys.map(|found| {
        Ok(Found {
            key: bytes(&found["key"])?,
            value: bytes(&found["value"])?,
            created: number(&found["create_revision"])?,
            written: number(&found["mod_revision"])?,
        })
    })
    .collect()
}

impl std::fmt::Display for GatewayError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Away(cause) | Self::Full(cause) | Self::Refused(cause) | Self::Unknown(cause) => {
                f.write_str(cause)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{ErrorKind, Read, Write};
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn who_redirects_is_not_followed() {
        let [member, elsewhere] = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        let place = format!("etcd://{}/world", member.local_addr().unwrap());
        let location = elsewhere.local_addr().unwrap();
        elsewhere.set_nonblocking(true).unwrap();
        let answered = std::thread::spawn(move || {
            let (mut stream, _) = member.accept().unwrap();
            let (mut asked, mut part) = (Vec::new(), [0; 1 << 10]);
            // Reads the whole request, which ends with the end of its JSON.
            while !asked.ends_with(b"}") {
                let read = stream.read(&mut part).unwrap();
                asked.extend_from_slice(&part[..read]);
            }
            let head = format!("HTTP/1.1 307 -\r\nLocation: http://{location}/v3/kv/range\r\n");
            write!(stream, "{head}Connection: close\r\nContent-Length: 0\r\n\r\n").unwrap();
        });
        let mut gateway = Gateway::new(&EtcdAddress::parse(&place).unwrap()).unwrap();
        let answer = gateway.read(b"key");
        answered.join().unwrap();
        assert!(matches!(&answer, Err(GatewayError::Refused(why)) if why.contains("307")), "{answer:?}");
        assert_eq!(elsewhere.accept().unwrap_err().kind(), ErrorKind::WouldBlock, "nobody asks there");
    }

    #[test]
    fn what_etcd_leaves_out_is_empty_and_what_is_not_etcds_is_an_error() {
        let answer = json!({ "kvs": [{ "key": "YQ==", "create_revision": "3", "mod_revision": "12" }] });
        let found = found(&answer).unwrap().pop().unwrap();
        assert_eq!((found.key, found.value, found.created, found.written), (b"a".to_vec(), vec![], 3, 12));
        assert!(super::found(&json!({ "count": "0" })).unwrap().is_empty());
        for wrong in [json!({ "kvs": [{ "key": "?" }] }), json!({ "kvs": [{ "key": "YQ==" }] })] {
            assert!(super::found(&wrong).is_err(), "{wrong}");
        }
    }
}
