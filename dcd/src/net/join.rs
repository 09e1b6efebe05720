//! Joins a server, and answers joins: a process without a name trades a token for a certificate.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use quinn::crypto::rustls::QuicClientConfig;
use quinn::{Connection, ConnectionError, Endpoint};
use rustls::pki_types::CertificateDer;

use super::fields::{Fields, put_counted};
use super::first::{AGAIN, first_of};
use super::key::{Key, PublicKey};
use super::renewal_request::RenewalRequest;
use super::seldom::Seldom;
use super::unasked::Unasked;
use super::verify::joining;
use super::{
    Authority, CloseCode, Identity, JoinRefusal, JoinRole, Limits, NetError, PROTOCOL_VERSION, PeerName,
    ResumeKey, Token,
};
use crate::space::{ClientId, NodeId};

/// Trades a token for an identity at the server on one of these addresses, and waits at most `timeout`. With
/// the resume key of an earlier identity the ids are the same again.
///
/// # Panics
/// Inside a tokio runtime: this call blocks.
pub fn join(
    servers: &[SocketAddr],
    token: &Token,
    resume: Option<&ResumeKey>,
    timeout: Duration,
) -> Result<Identity, NetError> {
    let key = Key::generate()?;
    let token_text = token.to_string();
    let request = JoinRequest {
        key: key.public(),
        proof: key.prove(&token_text),
        token: token_text,
        resume: resume.map(ResumeKey::to_string),
    };
    let request = request.encode(PROTOCOL_VERSION);
    let (server, reply) = exchange(servers, token.fingerprint, &request, timeout)?;
    let broken = |detail: &str| NetError::Broken { addr: server, detail: detail.to_owned() };
    let admission = match decode_reply(&reply).ok_or_else(|| broken("its answer cannot be read"))? {
        Ok(admission) => admission,
        Err(refused) => return Err(refused.by(server)),
    };
    Ok(Identity {
        who: admission.who,
        key: key.der().clone_key(),
        certificate: CertificateDer::from(admission.certificate),
        authority: CertificateDer::from(admission.authority),
        expires_unix_s: admission.expires_unix_s,
        resume: Some(admission.resume.parse()?),
    })
}

/// A request to join.
pub(super) struct JoinRequest {
    pub(super) token: String,
    /// The joiner's key, for which it requests a certificate.
    pub(super) key: PublicKey,
    /// Proof that the joiner has the private half of the key.
    pub(super) proof: Vec<u8>,
    pub(super) resume: Option<String>,
}

/// The answer to a granted request.
pub(super) struct Admission {
    pub(super) who: PeerName,
    pub(super) certificate: Vec<u8>,
    pub(super) authority: Vec<u8>,
    pub(super) expires_unix_s: u64,
    pub(super) resume: String,
}

/// The answer to a request that is not granted.
pub(super) struct Refused {
    /// Says whether the token cannot be used, while another one may be.
    is_of_token: bool,
    reason: String,
}

impl Refused {
    /// Returns the error of the process that asked this server.
    pub(super) fn by(self, addr: SocketAddr) -> NetError {
        let Self { is_of_token, reason } = self;
        match is_of_token {
            true => NetError::TokenRefused { addr, reason },
            false => NetError::Refused { addr, code: CloseCode::REFUSED, reason },
        }
    }
}

/// The first byte of a refusal.
const REFUSED: u8 = 0;
/// The first byte of an answer that grants the request.
const ADMITTED: u8 = 1;
/// The first byte of a refusal because of the token.
const TOKEN_REFUSED: u8 = 2;

/// The longest wait. A caller may ask for a longer one, but no clock counts for ever.
const LONGEST: Duration = Duration::from_secs(365 * 24 * 3600);

/// The longest request or answer. A longer one ends the connection.
const MESSAGE_LIMIT_BYTES: usize = 16 << 10;
/// The first bytes of a request to join, of any version.
const MAGIC: [u8; 4] = *b"join";

impl JoinRequest {
    pub(super) fn encode(&self, version: u32) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(version.to_be_bytes());
        put_counted(&mut bytes, self.token.as_bytes());
        bytes.extend(self.key.0);
        put_counted(&mut bytes, &self.proof);
        put_counted(&mut bytes, self.resume.as_deref().unwrap_or_default().as_bytes());
        bytes
    }

    /// Decodes a request. The version comes first, since what follows it may differ between versions.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, JoinRefusal> {
        let mut fields = Fields(bytes);
        if fields.take() != Some(MAGIC) {
            return Err(JoinRefusal::Malformed("its beginning"));
        }
        let joiner = u32::from_be_bytes(fields.take().ok_or(JoinRefusal::Malformed("its version"))?);
        if joiner != PROTOCOL_VERSION {
            return Err(JoinRefusal::Version { server: PROTOCOL_VERSION, joiner });
        }
        let mut read = || {
            let token = String::from_utf8(fields.take_counted()?.to_vec()).ok()?;
            let key = PublicKey(fields.take()?);
            let proof = fields.take_counted()?.to_vec();
            let resume = String::from_utf8(fields.take_counted()?.to_vec()).ok()?;
            fields.end()?;
            Some(Self { token, key, proof, resume: Some(resume).filter(|key| !key.is_empty()) })
        };
        read().ok_or(JoinRefusal::Malformed("its fields"))
    }
}

fn encode_reply(answer: &Result<Admission, JoinRefusal>) -> Vec<u8> {
    match answer {
        Err(refusal) => {
            let kind = if refusal.is_of_token() { TOKEN_REFUSED } else { REFUSED };
            [&[kind], refusal.to_string().as_bytes()].concat()
        }
        Ok(admission) => {
            let mut bytes = vec![ADMITTED, admission.who.role().code()];
            bytes.extend(admission.who.node().unwrap_or_default().0.to_be_bytes());
            bytes.extend(admission.who.client().unwrap_or_default().0.to_be_bytes());
            bytes.extend(admission.expires_unix_s.to_be_bytes());
            put_counted(&mut bytes, &admission.certificate);
            put_counted(&mut bytes, &admission.authority);
            put_counted(&mut bytes, admission.resume.as_bytes());
            bytes
        }
    }
}

pub(super) fn decode_reply(bytes: &[u8]) -> Option<Result<Admission, Refused>> {
    let mut fields = Fields(bytes);
    match fields.take()? {
        [kind @ (REFUSED | TOKEN_REFUSED)] => {
            let reason = String::from_utf8_lossy(fields.0).into_owned();
            Some(Err(Refused { is_of_token: kind == TOKEN_REFUSED, reason }))
        }
        [ADMITTED] => {
            let role = JoinRole::from_code(fields.take::<1>()?[0])?;
            let node = Some(u32::from_be_bytes(fields.take()?)).filter(|id| *id > 0).map(NodeId);
            let client = Some(u32::from_be_bytes(fields.take()?)).filter(|id| *id > 0).map(ClientId);
            let who = PeerName::from_parts(role, node, client)?;
            let expires_unix_s = u64::from_be_bytes(fields.take()?);
            let certificate = fields.take_counted()?.to_vec();
            let authority = fields.take_counted()?.to_vec();
            let resume = String::from_utf8(fields.take_counted()?.to_vec()).ok()?;
            fields.end()?;
            Some(Ok(Admission { who, certificate, authority, expires_unix_s, resume }))
        }
        _ => None,
    }
}

/// Decodes bytes as each message of a join: request, renewal and answer. For tests, since anybody who finds
/// the port may send any bytes.
#[doc(hidden)]
pub fn read_joining(bytes: &[u8]) {
    let _ = (JoinRequest::decode(bytes), RenewalRequest::decode(bytes), decode_reply(bytes));
}

/// Dials without a name and sends `request`. Returns the answer, and the address of the server that gave it.
pub(super) fn exchange(
    servers: &[SocketAddr],
    fingerprint: [u8; 32],
    request: &[u8],
    timeout: Duration,
) -> Result<(SocketAddr, Vec<u8>), NetError> {
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(NetError::Threads)?;
    runtime.block_on(exchange_here(servers, fingerprint, request, timeout))
}

/// Does the same as [`exchange`], on the caller's runtime.
pub(super) async fn exchange_here(
    servers: &[SocketAddr],
    fingerprint: [u8; 32],
    request: &[u8],
    timeout: Duration,
) -> Result<(SocketAddr, Vec<u8>), NetError> {
    let timeout = timeout.min(LONGEST);
    let deadline = tokio::time::Instant::now() + timeout;
    let dialled = |server| async move {
        let (endpoint, dialling) = anonymous(server, fingerprint, timeout)?;
        let connection = dialling.await.map_err(|error| explain(server, PeerName::Server, timeout, error))?;
        Ok((server, endpoint, connection))
    };
    loop {
        let left = deadline.saturating_duration_since(tokio::time::Instant::now());
        let (server, _endpoint, connection) = first_of(servers, left, dialled).await?;
        let answer = tokio::time::timeout_at(deadline, ask(&connection, request)).await;
        say_goodbye(&connection).await;
        let answer = answer.map_err(|_| NetError::Unreachable { addr: server, waited: timeout })?;
        match answer.map_err(|error| explain(server, PeerName::Server, timeout, error)) {
            Ok(answer) => return Ok((server, answer)),
            // The server was about to stop, and another one takes over.
            Err(_) if servers.len() > 1 && tokio::time::Instant::now() + AGAIN < deadline => {
                tokio::time::sleep(AGAIN).await;
            }
            Err(error) => return Err(error),
        }
    }
}

/// Closes the connection and waits until the close is sent. It does not wait for the three time-outs after
/// which nobody can be left unanswered: if the close is lost, the server stops waiting by itself.
async fn say_goodbye(connection: &Connection) {
    if connection.close_reason().is_some() {
        return;
    }
    let sent = || connection.stats().udp_tx.datagrams;
    let before = sent();
    connection.close(CloseCode::DONE.into(), b"joined");
    let on_its_way = async {
        while sent() == before {
            tokio::task::yield_now().await;
        }
    };
    let _ = tokio::time::timeout(Duration::from_millis(200), on_its_way).await;
}

/// Makes an endpoint without a certificate, and its connection to a server.
pub(super) fn anonymous(
    server: SocketAddr,
    fingerprint: [u8; 32],
    timeout: Duration,
) -> Result<(Endpoint, quinn::Connecting), NetError> {
    let local = match server {
        SocketAddr::V4(_) => SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)),
        SocketAddr::V6(_) => SocketAddr::from((Ipv6Addr::UNSPECIFIED, 0)),
    };
    let endpoint = Endpoint::client(local).map_err(|source| NetError::Bind { addr: local, source })?;
    let crypto = QuicClientConfig::try_from(joining(fingerprint)?)
        .map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = quinn::ClientConfig::new(Arc::new(crypto));
    let limits = Limits::default();
    config.transport_config(limits.transport(timeout, Some(limits.keep_alive), 0));
    let name = &PeerName::Server.dns_names()[0];
    let connecting = endpoint
        .connect_with(config, server, name)
        .map_err(|error| NetError::Broken { addr: server, detail: error.to_string() })?;
    Ok((endpoint, connecting))
}

async fn ask(connection: &Connection, request: &[u8]) -> Result<Vec<u8>, ConnectionError> {
    let (mut send, mut receive) = connection.open_bi().await?;
    let sent = send.write_all(request).await.is_ok() && send.finish().is_ok();
    match receive.read_to_end(MESSAGE_LIMIT_BYTES).await {
        Ok(answer) if sent => Ok(answer),
        _ => {
            connection.close(CloseCode::VIOLATION.into(), b"no answer to a join request");
            Err(connection.closed().await)
        }
    }
}

/// Answers a join on the server's side: reads one request, answers it, and does nothing else. `decided` is
/// called with whether the peer is admitted, before the peer learns it.
pub(super) async fn answer(
    connection: &Connection,
    authority: Arc<Authority>,
    limits: &Limits,
    refusals: &Seldom,
    unasked: &Unasked,
    decided: impl FnOnce(bool),
) {
    let deadline = tokio::time::Instant::now() + limits.handshake_timeout;
    let request = async {
        tokio::select! {
            streams = connection.accept_bi() => streams.ok(),
            _ = connection.accept_uni() => None,
            _ = connection.read_datagram() => None,
        }
    };
    let request = async {
        let (send, mut receive) = request.await?;
        Some((send, receive.read_to_end(MESSAGE_LIMIT_BYTES).await.ok()?))
    };
    let place = unasked.enter(connection);
    let asked = tokio::time::timeout_at(deadline, request).await;
    drop(place);
    let Ok(Some((mut send, request))) = asked else {
        connection.close(
            CloseCode::VIOLATION.into(),
            b"a peer without a certificate may only ask to join, with `dcd token`'s text",
        );
        return decided(false);
    };
    // On another thread, since signing and writing to disk would hold up all connections.
    let renews = RenewalRequest::is_one(&request);
    let answer = tokio::task::spawn_blocking(move || match renews {
        true => authority.renew(&RenewalRequest::decode(&request)?, SystemTime::now()),
        false => authority.admit(&JoinRequest::decode(&request)?, SystemTime::now()),
    });
    let answer = answer.await.unwrap_or_else(|error| Err(JoinRefusal::Server(error.to_string())));
    match &answer {
        Ok(admission) => {
            let done = if renews { "its certificate is renewed" } else { "joined" };
            tracing::info!(who = %admission.who, addr = %connection.remote_address(), "{done}");
        }
        Err(refusal) => {
            if let Some(left_out) = refusals.tell(std::time::Instant::now()) {
                tracing::warn!(addr = %connection.remote_address(), left_out, "join refused: {refusal}");
            }
        }
    }
    decided(answer.is_ok());
    // A refused peer gives way to others while it reads the reason. So does one that renews, which can ask
    // again: its token is not used up.
    let place = (renews || answer.is_err()).then(|| unasked.enter(connection));
    let read = async {
        if send.write_all(&encode_reply(&answer)).await.is_ok() && send.finish().is_ok() {
            // The joiner closes the connection when it has read the answer.
            connection.closed().await;
        }
    };
    // There is time to read, however long it took to decide.
    let until = deadline.max(tokio::time::Instant::now() + limits.linger);
    let _ = tokio::time::timeout_at(until, read).await;
    drop(place);
    connection.close(CloseCode::DONE.into(), b"answered");
}

/// The code by which QUIC tells that a certificate has expired: TLS's alert 45 (RFC 8446, section 6; RFC 9001,
/// section 4.8).
const CERTIFICATE_EXPIRED: u64 = 0x100 + 45;

/// Returns whether the other side ended a handshake since our certificate has expired by its clock.
pub(super) fn finds_us_expired(error: &ConnectionError) -> bool {
    matches!(error, ConnectionError::ConnectionClosed(close) if u64::from(close.error_code) == CERTIFICATE_EXPIRED)
}

/// Returns whether this side ended a handshake since the other's certificate has expired by our clock.
pub(super) fn is_expired(error: &ConnectionError) -> bool {
    matches!(error, ConnectionError::TransportError(error) if u64::from(error.code) == CERTIFICATE_EXPIRED)
}

/// Returns the error for a connection that we dialled and that failed.
pub(super) fn explain(
    addr: SocketAddr,
    expected: PeerName,
    waited: Duration,
    error: ConnectionError,
) -> NetError {
    let is_tls = |code: quinn::TransportErrorCode| (0x100..0x200).contains(&u64::from(code));
    match error {
        ConnectionError::TimedOut => NetError::Unreachable { addr, waited },
        ConnectionError::TransportError(error) if is_tls(error.code) => {
            NetError::WrongPeer { addr, expected, detail: error.reason.replace("unexpected error: ", "") }
        }
        ConnectionError::ConnectionClosed(close) if is_tls(close.error_code) => NetError::Refused {
            addr,
            code: CloseCode::REFUSED,
            reason: format!(
                "it does not accept our certificate ({}); join anew with a fresh token of its server, and see that the clocks \
                 of both machines agree",
                close.error_code
            ),
        },
        ConnectionError::ConnectionClosed(close)
            if close.error_code == quinn::TransportErrorCode::CONNECTION_REFUSED =>
        {
            // QUIC says no more.
            let reason = "it takes no more connections: it is about to end, or has no room for them; see whether it runs on, and try again \
                          later";
            NetError::Refused { addr, code: CloseCode::REFUSED, reason: reason.to_owned() }
        }
        ConnectionError::ApplicationClosed(close) => {
            let reason = String::from_utf8_lossy(&close.reason).into_owned();
            NetError::Refused { addr, code: CloseCode::of(&close), reason }
        }
        error => NetError::Broken { addr, detail: error.to_string() },
    }
}
