//! Keeps the metrics that servers and nodes serve over HTTP. Their loops write numbers down once per tick or
//! turn, and a scrape copies them. Only a scrape of a server also locks the server's record, to count it.

mod node;
mod resources;
mod server;

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tracing::info;

pub(super) use self::node::{NodeGauge, NodeMetrics};
pub(super) use self::server::ServerMetrics;
use super::ProcessError;
use super::bandwidth::LinkTotals;
use crate::metrics::{Endpoint, Source, Text};
use crate::protocol::VERSION;

/// A loop that has not turned for this long hangs. It turns at least twice per second, except while it builds
/// a large world.
const HUNG: Duration = Duration::from_secs(30);

/// Bounds of times, seconds. A tick has 1/60 s.
const SECONDS: &[f64] =
    &[0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.0167, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0];

/// Starts to serve the metrics of a process.
pub(super) fn start(address: SocketAddr, source: Arc<dyn Source>) -> Result<Endpoint, ProcessError> {
    let endpoint = Endpoint::start(address, source);
    let endpoint = endpoint.map_err(|cause| ProcessError::Metrics { address, cause })?;
    info!(address = %endpoint.address(), "metrics are told");
    Ok(endpoint)
}

/// Checks that this address can be listened on now.
pub(super) fn check(address: SocketAddr) -> Result<(), ProcessError> {
    TcpListener::bind(address).map(drop).map_err(|cause| ProcessError::Metrics { address, cause })
}

/// Returns an error if a loop that turned last at this time is not healthy.
fn turns(turned: Option<Instant>) -> Result<(), String> {
    match turned.map(|turned| turned.elapsed()) {
        Some(ago) if ago >= HUNG => Err(format!("the loop has not turned for {} s", ago.as_secs())),
        _ => Ok(()),
    }
}

/// Writes the metrics that all processes have: who they are, what they use, and what went over their links.
/// `refused` counts messages by cause.
fn write_common(text: &mut Text, role: &str, links: &LinkTotals, refused: &[(&str, u64)]) {
    let labels = [("version", env!("CARGO_PKG_VERSION")), ("protocol", &VERSION.to_string()), ("role", role)];
    text.gauge("dcd_build_info", "The version of this process, and what it is; always 1.").of(&labels, 1.0);
    resources::write(text);
    let traffic = links.net.traffic;
    text.gauge("dcd_peers", "Links that are up.").is(links.net.peers as f64);
    let directions = [("in", links.received), ("out", links.sent)];
    let mut messages = text.counter("dcd_messages_total", "Messages over all links, by what they are about.");
    for (direction, counts) in &directions {
        for (subject, count) in counts.iter() {
            messages.of(&[("direction", direction), ("subject", subject.name())], count.messages as f64);
        }
    }
    let mut bytes =
        text.counter("dcd_message_bytes_total", "Bytes of these messages, without what QUIC adds.");
    for (direction, counts) in &directions {
        for (subject, count) in counts.iter() {
            bytes.of(&[("direction", direction), ("subject", subject.name())], count.bytes as f64);
        }
    }
    text.counter("dcd_udp_bytes_total", "Bytes of UDP over all links: messages, and what QUIC adds.")
        .of(&[("direction", "in")], traffic.udp_bytes_in as f64)
        .of(&[("direction", "out")], traffic.udp_bytes_out as f64);
    text.counter("dcd_packets_sent_total", "Packets of QUIC sent.").is(traffic.packets_out as f64);
    text.counter("dcd_packets_lost_total", "Packets of QUIC lost on their way, as far as it knows.")
        .is(traffic.packets_lost as f64);
    text.counter(
        "dcd_datagrams_dropped_total",
        "Datagrams dropped here: a link, or this process, was slow, or a client sent too many.",
    )
    .is(traffic.datagrams_dropped as f64);
    text.counter(
        "dcd_frames_held_back_total",
        "Frames of clients that sent faster than they may, read later.",
    )
    .is(traffic.frames_held_back as f64);
    text.gauge("dcd_round_trip_seconds", "The longest round trip of all links, smoothed.")
        .is(traffic.rtt.as_secs_f64());
    text.gauge("dcd_queue_bytes", "Bytes that wait to be sent: in this process (links), and in QUIC.")
        .of(&[("queue", "links")], links.waiting_bytes as f64)
        .of(&[("queue", "quic")], traffic.bytes_waiting as f64);
    let mut rejections =
        text.counter("dcd_rejections_total", "What others sent and was not accepted, by cause.");
    rejections
        .of(&[("cause", "handshake")], links.net.handshakes_refused as f64)
        .of(&[("cause", "join")], links.net.joins_refused as f64)
        .of(&[("cause", "violation")], links.net.violations as f64)
        .of(&[("cause", "malformed")], links.malformed as f64);
    for (cause, count) in refused {
        rejections.of(&[("cause", cause)], *count as f64);
    }
}
