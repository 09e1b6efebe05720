//! Calls a process over QUIC as no honest process does: with handshakes that are begun and go no further,
//! without a name or with one.

use std::collections::BTreeMap;
use std::error::Error;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

use dcd::net::{Identity, PROTOCOL_VERSION};
use quinn::crypto::rustls::QuicClientConfig;
use quinn_proto::{
    ClientConfig, Connection, ConnectionHandle, DatagramEvent, Endpoint, EndpointConfig, EndpointEvent,
};
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use rustls::{DigitallySignedStruct, SignatureScheme};

/// The number of lanes of a link.
const LANES: u8 = 4;
/// The most handshakes that may wait for an answer; beyond that the oldest is forgotten.
const WAITING: usize = 2_000;

/// A caller that begins handshakes from one address, each as a stranger of its own.
pub(super) struct Caller {
    endpoint: Endpoint,
    config: ClientConfig,
    socket: UdpSocket,
    target: SocketAddr,
    /// The handshakes that wait, by the order in which they were begun.
    waiting: BTreeMap<u64, (ConnectionHandle, Connection)>,
    /// The number of the handshake that has a handle now; another may have had the handle before.
    numbers: BTreeMap<usize, u64>,
    begun: u64,
    packets: Vec<u8>,
}

impl Caller {
    pub(super) fn new(target: SocketAddr) -> Result<Self, Box<dyn Error>> {
        let socket = UdpSocket::bind("127.0.0.1:0")?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            endpoint: Endpoint::new(Arc::new(EndpointConfig::default()), None, true, None),
            config: ClientConfig::new(Arc::new(QuicClientConfig::try_from(tls(None)?)?)),
            socket,
            target,
            waiting: BTreeMap::new(),
            numbers: BTreeMap::new(),
            begun: 0,
            packets: Vec::new(),
        })
    }

    /// Sends the first packet of a handshake.
    pub(super) fn begin(&mut self) -> Result<(), Box<dyn Error>> {
        let now = Instant::now();
        let (handle, mut connection) =
            self.endpoint.connect(now, self.config.clone(), self.target, "server.dcd")?;
        self.send(now, &mut connection);
        self.waiting.insert(self.begun, (handle, connection));
        self.numbers.insert(handle.0, self.begun);
        self.begun += 1;
        if self.waiting.len() > WAITING {
            let (_, (oldest, _)) = self.waiting.pop_first().ok_or("one was put in")?;
            self.numbers.remove(&oldest.0);
            self.endpoint.handle_event(oldest, EndpointEvent::drained());
        }
        Ok(())
    }

    /// Proves this address to each peer that has asked for that, and says nothing more. Returns how often.
    pub(super) fn prove(&mut self) -> u64 {
        let mut packet = [0; 2_048];
        let mut proved = 0;
        while let Ok((length, from)) = self.socket.recv_from(&mut packet) {
            let (now, bytes) = (Instant::now(), packet[..length].iter().copied().collect());
            let event = self.endpoint.handle(now, from, None, None, bytes, &mut self.packets);
            self.packets.clear();
            let Some(DatagramEvent::ConnectionEvent(handle, event)) = event else { continue };
            let number = self.numbers.remove(&handle.0);
            let Some((_, mut connection)) = number.and_then(|number| self.waiting.remove(&number)) else {
                continue;
            };
            connection.handle_event(event);
            self.send(now, &mut connection);
            self.endpoint.handle_event(handle, EndpointEvent::drained());
            proved += 1;
        }
        proved
    }

    fn send(&mut self, now: Instant, connection: &mut Connection) {
        while let Some(transmit) = connection.poll_transmit(now, 1, &mut self.packets) {
            // A socket whose buffer is full loses the packet, as a network would.
            let _ = self.socket.send_to(&self.packets[..transmit.size], self.target);
            self.packets.clear();
        }
    }
}

/// Returns the settings of a peer without a name, or of one that has joined. The peer takes in so many bytes
/// of each stream, and four times as many of the connection.
pub(super) fn settings(
    identity: Option<&Identity>,
    window_bytes: u32,
) -> Result<quinn::ClientConfig, Box<dyn Error>> {
    let mut config = quinn::ClientConfig::new(Arc::new(QuicClientConfig::try_from(tls(identity)?)?));
    let mut transport = quinn::TransportConfig::default();
    transport
        .max_concurrent_uni_streams(u32::from(LANES).into())
        .stream_receive_window(window_bytes.into())
        .receive_window((4 * window_bytes).into())
        .keep_alive_interval(Some(Duration::from_millis(500)))
        .max_idle_timeout(Some(Duration::from_secs(60).try_into()?));
    config.transport_config(Arc::new(transport));
    Ok(config)
}

/// A link of a peer that has joined. Nothing that comes over it is read.
pub(super) struct Link {
    pub(super) connection: quinn::Connection,
    pub(super) lanes: Vec<quinn::SendStream>,
    _unread: Vec<quinn::RecvStream>,
}

impl Link {
    /// Connects to a server or node, and greets it.
    pub(super) async fn make(
        endpoint: &quinn::Endpoint,
        settings: &quinn::ClientConfig,
        target: SocketAddr,
    ) -> Result<Self, Box<dyn Error + Send + Sync>> {
        let connection = endpoint.connect_with(settings.clone(), target, "server.dcd")?.await?;
        let (mut lanes, mut unread) = (Vec::new(), Vec::new());
        for lane in 0..LANES {
            let mut stream = connection.open_uni().await?;
            stream.write_all(&[&[lane][..], &PROTOCOL_VERSION.to_le_bytes()].concat()).await?;
            lanes.push(stream);
        }
        for _ in 0..LANES {
            let mut stream = connection.accept_uni().await?;
            stream.read_exact(&mut [0; 5]).await?;
            unread.push(stream);
        }
        Ok(Self { connection, lanes, _unread: unread })
    }

    /// Sends a frame on a lane.
    pub(super) async fn say(&mut self, lane: usize, frame: &[u8]) -> Result<(), quinn::WriteError> {
        let length = (frame.len() as u32).to_le_bytes();
        self.lanes[lane].write_all(&[&length[..], frame].concat()).await
    }
}

fn tls(identity: Option<&Identity>) -> Result<rustls::ClientConfig, Box<dyn Error>> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = rustls::ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&rustls::version::TLS13])?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(Anybody));
    let mut config = match identity {
        None => builder.with_no_client_auth(),
        Some(identity) => {
            let folder = tempfile::tempdir()?;
            let path = folder.path().join("identity");
            identity.save(&path)?;
            let text = std::fs::read(&path)?;
            let chain = CertificateDer::pem_slice_iter(&text).collect::<Result<Vec<_>, _>>()?;
            builder.with_client_auth_cert(chain, PrivateKeyDer::from_pem_slice(&text)?)?
        }
    };
    config.alpn_protocols = vec![b"dcd".to_vec()];
    Ok(config)
}

/// A verifier that trusts whoever answers: what matters is what the call costs the peer.
#[derive(Debug)]
struct Anybody;

impl ServerCertVerifier for Anybody {
    fn verify_server_cert(
        &self,
        _: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Ok(HandshakeSignatureValid::assertion())
    }

    fn verify_tls13_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Ok(HandshakeSignatureValid::assertion())
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        vec![SignatureScheme::ED25519]
    }
}
