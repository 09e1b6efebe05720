//! Floods a server and a node, at a low priority and on one core, so that what the flood takes of the machine
//! does not count as what it does to them.

use std::error::Error;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use dcd::net::{Identity, JoinRole, Token, join};
use dcd::protocol::{FromClient, Hello, JoinAs, Message, Ping, VERSION, encode};
use dcd::sim::Random;
use rustix::thread::{CpuSet, sched_setaffinity};
use serde::{Deserialize, Serialize};

use super::calls::{Caller, Link, settings};
use crate::child::answer;

const LIMIT: Duration = Duration::from_secs(60);
/// The number of handshakes per second that are tried.
const HANDSHAKES_PER_S: u64 = 10_000;
/// The number of connections that a flood of finished handshakes holds or makes at the same time.
const AT_A_TIME: usize = 256;
/// The bytes of a stream that are taken in by a peer that reads nothing.
const SLOW_WINDOW_BYTES: u32 = 1_024;
const USUAL_WINDOW_BYTES: u32 = 1 << 20;
/// The number of frames in one write.
const FRAMES_AT_ONCE: usize = 100;
const ADMIN: usize = 0;
const CLIENT: usize = 2;

/// What hostile peers do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Flood {
    /// Nothing: the process only computes beside the world, as all others do beside flooding.
    BusyCore,
    /// First packets of handshakes, at the server.
    Begun,
    /// The same at the node.
    BegunAtNode,
    /// Handshakes whose peers prove their address and then fall silent, at the server.
    Proved,
    /// The same at the node.
    ProvedAtNode,
    /// Handshakes that are finished without a name, after which nothing is asked, at the server.
    Finished,
    /// The same at the node, which lets nobody in without a name.
    FinishedAtNode,
    /// Datagrams of random bytes, some of which look like QUIC, at the server.
    Datagrams,
    /// The same at the node.
    DatagramsAtNode,
    /// Clients that are let in, read nothing, and come again when they are sent away.
    SlowClients,
    /// Participants that do so.
    SlowParticipants,
    /// Dedicated nodes that do so.
    SlowNodes,
    /// Clients that send frames of random bytes, and come again.
    Junk,
    /// Clients that send messages that mean nothing, as many as are read.
    Pings,
}

impl Flood {
    /// Returns the role in which its peers join, and their number.
    pub(super) fn peers(self) -> Option<(JoinRole, u32)> {
        match self {
            Self::SlowClients => Some((JoinRole::Client, 100)),
            Self::SlowParticipants => Some((JoinRole::Participant, 10)),
            Self::SlowNodes => Some((JoinRole::Node, 10)),
            Self::Junk | Self::Pings => Some((JoinRole::Client, 10)),
            _ => None,
        }
    }
}

/// Runs the hostile process.
#[derive(Args)]
pub(super) struct Hostile {
    #[arg(long)]
    flood: Flood,
    #[arg(long)]
    server: SocketAddr,
    #[arg(long)]
    node: SocketAddr,
    /// Token by which its peers join.
    #[arg(long)]
    token: Option<String>,
    #[arg(long)]
    seconds: f64,
    /// Number of datagrams to send, however long that takes.
    #[arg(long)]
    datagrams: u64,
    /// Priority in the system, 0 to 19, which is the lowest.
    #[arg(long)]
    nice: i32,
}

/// The number of handshakes, datagrams, links or frames sent, and the time that took.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Sent {
    pub(super) count: u64,
    pub(super) seconds: f64,
}

impl Hostile {
    /// Says when it is ready, floods once it is told to, and then says what it sent.
    pub(super) fn run(self) -> Result<(), Box<dyn Error>> {
        rustix::process::setpriority_process(None, self.nice)?;
        let mut last = CpuSet::new();
        last.set(std::thread::available_parallelism()?.get() - 1);
        sched_setaffinity(None, &last)?;
        let peers = self.join()?;
        println!("ready");
        let mut result = Ok(Sent::default());
        answer(|| {
            let start = Instant::now();
            match self.flood(&peers, start + Duration::from_secs_f64(self.seconds)) {
                Ok(count) => Sent { count, seconds: start.elapsed().as_secs_f64() },
                Err(error) => {
                    result = Err(error);
                    Sent::default()
                }
            }
        })?;
        result.map(drop)
    }

    fn join(&self) -> Result<Vec<Identity>, Box<dyn Error>> {
        let Some((token, (_, count))) = self.token.as_ref().zip(self.flood.peers()) else {
            return Ok(Vec::new());
        };
        let token: Token = token.parse()?;
        (0..count).map(|_| Ok(join(&[self.server], &token, None, LIMIT)?)).collect()
    }

    fn flood(&self, peers: &[Identity], until: Instant) -> Result<u64, Box<dyn Error>> {
        match self.flood {
            Flood::BusyCore => {
                while Instant::now() < until {
                    std::hint::black_box((0..10_000).fold(0_u64, |sum, i| sum.wrapping_mul(31) + i));
                }
                Ok(0)
            }
            Flood::Begun => begin(self.server, until, false),
            Flood::BegunAtNode => begin(self.node, until, false),
            Flood::Proved => begin(self.server, until, true),
            Flood::ProvedAtNode => begin(self.node, until, true),
            Flood::Finished => finish(self.server, until),
            Flood::FinishedAtNode => finish(self.node, until),
            Flood::Datagrams => datagrams(self.server, self.datagrams),
            Flood::DatagramsAtNode => datagrams(self.node, self.datagrams),
            _ => self.let_in(peers, until),
        }
    }

    /// Lets the peers that have joined act as the flood says.
    fn let_in(&self, peers: &[Identity], until: Instant) -> Result<u64, Box<dyn Error>> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let sent = AtomicU64::new(0);
        // Nobody answers at this address.
        let silent = UdpSocket::bind("127.0.0.1:0")?;
        let address = silent.local_addr()?;
        runtime.block_on(async {
            let endpoint = quinn::Endpoint::client("127.0.0.1:0".parse()?)?;
            let window = if self.flood == Flood::Junk || self.flood == Flood::Pings {
                USUAL_WINDOW_BYTES
            } else {
                SLOW_WINDOW_BYTES
            };
            let mut peers = peers
                .iter()
                .map(|identity| {
                    let peer = Peer {
                        endpoint: &endpoint,
                        settings: settings(Some(identity), window)?,
                        identity,
                        server: self.server,
                        node: self.node,
                        address,
                        sent: &sent,
                    };
                    Ok(Box::pin(peer.act(self.flood)))
                })
                .collect::<Result<Vec<_>, Box<dyn Error>>>()?;
            let all = std::future::poll_fn(|context| {
                for peer in &mut peers {
                    let _ = peer.as_mut().poll(context);
                }
                std::task::Poll::<()>::Pending
            });
            let _ = tokio::time::timeout_at(until.into(), all).await;
            Ok::<_, Box<dyn Error>>(())
        })?;
        Ok(sent.into_inner())
    }
}

/// A peer that has been let in.
struct Peer<'a> {
    endpoint: &'a quinn::Endpoint,
    settings: quinn::ClientConfig,
    identity: &'a Identity,
    server: SocketAddr,
    node: SocketAddr,
    /// The address at which the peer says that it listens.
    address: SocketAddr,
    sent: &'a AtomicU64,
}

impl Peer<'_> {
    async fn act(self, flood: Flood) {
        let mut random = Random::new(u64::from(self.identity.client().map_or(0, |client| client.0)));
        loop {
            let result = match flood {
                Flood::Junk => self.talk_rubbish(&mut random).await,
                Flood::Pings => self.ping().await,
                _ => self.read_nothing().await,
            };
            // The peer was refused or sent away: it comes again, but not in a busy loop.
            if result.is_err() {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        }
    }

    /// Connects to the server and greets it in the peer's role.
    async fn greeted(&self) -> Result<Link, Box<dyn Error + Send + Sync>> {
        let role = match self.identity.role() {
            JoinRole::Client => JoinAs::Client { interest: None },
            _ => {
                JoinAs::Node { address: self.address, client: self.identity.client(), resume: None, heard: 0 }
            }
        };
        let mut link = Link::make(self.endpoint, &self.settings, self.server).await?;
        link.say(ADMIN, &encode(&Message::Hello(Hello { version: VERSION, role }))).await?;
        Ok(link)
    }

    async fn read_nothing(&self) -> Result<(), Box<dyn Error + Send + Sync>> {
        let server = self.greeted().await?;
        let mut node = Link::make(self.endpoint, &self.settings, self.node).await?;
        if let Some(client) = self.identity.client() {
            node.say(CLIENT, &encode(&Message::FromClient(client, FromClient::Interest(None)))).await?;
        }
        self.sent.fetch_add(1, Ordering::Relaxed);
        server.connection.closed().await;
        Ok(())
    }

    async fn talk_rubbish(&self, random: &mut Random) -> Result<(), Box<dyn Error + Send + Sync>> {
        let target = if random.chance(0.5) { self.server } else { self.node };
        let mut link = Link::make(self.endpoint, &self.settings, target).await?;
        loop {
            let length = random.below(2_000);
            let frame: Vec<u8> = (0..length).map(|_| random.bits() as u8).collect();
            // A write does not wait until the peer has closed, so the task yields below.
            link.say(random.below(3) as usize, &frame).await?;
            self.sent.fetch_add(1, Ordering::Relaxed);
            tokio::task::yield_now().await;
        }
    }

    async fn ping(&self) -> Result<(), Box<dyn Error + Send + Sync>> {
        let mut server = self.greeted().await?;
        let mut node = Link::make(self.endpoint, &self.settings, self.node).await?;
        let message = encode(&Message::Ping(Ping { sent_us: 7 }));
        let frame = [&(message.len() as u32).to_le_bytes()[..], &message].concat().repeat(FRAMES_AT_ONCE);
        loop {
            for link in [&mut server, &mut node] {
                link.lanes[ADMIN].write_all(&frame).await?;
                self.sent.fetch_add(FRAMES_AT_ONCE as u64, Ordering::Relaxed);
            }
        }
    }
}

/// Begins handshakes, evenly over time as far as this process keeps up. Returns the number of first packets,
/// or of proofs where it proves its address.
fn begin(target: SocketAddr, until: Instant, proves: bool) -> Result<u64, Box<dyn Error>> {
    let (mut caller, start) = (Caller::new(target)?, Instant::now());
    let (mut begun, mut proved) = (0, 0);
    loop {
        let now = Instant::now();
        if now >= until {
            return Ok(if proves { proved } else { begun });
        }
        let due = (now - start).as_micros() as u64 * HANDSHAKES_PER_S / 1_000_000;
        // At most 20 at a time; what is still due follows in the next rounds.
        for _ in begun..due.min(begun + 20) {
            caller.begin()?;
        }
        begun = begun.max(due.min(begun + 20));
        if proves {
            proved += caller.prove();
        }
        if begun >= due {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Finishes handshakes without a name, as many as this process can, and keeps each connection until it is
/// closed.
fn finish(target: SocketAddr, until: Instant) -> Result<u64, Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let finished = runtime.block_on(async {
        let endpoint = quinn::Endpoint::client("127.0.0.1:0".parse()?)?;
        let settings = settings(None, USUAL_WINDOW_BYTES)?;
        let finished = std::sync::Arc::new(AtomicU64::new(0));
        for _ in 0..AT_A_TIME {
            let (endpoint, settings, finished) = (endpoint.clone(), settings.clone(), finished.clone());
            tokio::spawn(async move {
                while let Ok(connecting) = endpoint.connect_with(settings.clone(), target, "server.dcd") {
                    if let Ok(connection) = connecting.await {
                        finished.fetch_add(1, Ordering::Relaxed);
                        connection.closed().await;
                    }
                }
            });
        }
        tokio::time::sleep_until(until.into()).await;
        Ok::<_, Box<dyn Error>>(finished.load(Ordering::Relaxed))
    });
    runtime.shutdown_background();
    finished
}

/// Sends datagrams as fast as the socket takes them: of random bytes, and such as look like first packets,
/// like packets of unknown versions, or like packets of connections.
fn datagrams(target: SocketAddr, count: u64) -> Result<u64, Box<dyn Error>> {
    const LONGEST: usize = 1_200;
    let socket = UdpSocket::bind("127.0.0.1:0")?;
    let mut random = Random::new(1);
    let noise: Vec<u8> = (0..LONGEST + 256).map(|_| random.bits() as u8).collect();
    let mut packet = vec![0; LONGEST];
    for number in 0..count {
        let from = random.below(256) as usize;
        packet.copy_from_slice(&noise[from..from + LONGEST]);
        packet[6..14].copy_from_slice(&random.bits().to_le_bytes());
        let length = match number % 4 {
            // A first packet of QUIC, with ids of eight bytes and no token.
            0 => {
                packet[..6].copy_from_slice(&[0xc3, 0, 0, 0, 1, 8]);
                packet[14] = 8;
                let length = (LONGEST - 26) as u16 | 0x4000;
                packet[23..26].copy_from_slice(&[0, (length >> 8) as u8, length as u8]);
                LONGEST
            }
            // The same, of a version that nobody knows.
            1 => {
                packet[..6].copy_from_slice(&[0xc3, 0xaa, 0xbb, 0xcc, 0xdd, 8]);
                packet[14] = 8;
                LONGEST
            }
            // A packet of a connection that does not exist.
            2 => {
                packet[0] = 0x40 | packet[0] & 0x3f;
                21 + random.below(1_000) as usize
            }
            _ => 1 + random.below(LONGEST as u64) as usize,
        };
        socket.send_to(&packet[..length], target)?;
    }
    Ok(count)
}
