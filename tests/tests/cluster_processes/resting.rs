//! Measures the traffic of a client that shows a world at rest.

use std::time::{Duration, Instant};

use dcd::protocol::BodyKind;
use dcd::runtime::{ClientWorld, JoinConfig};

use crate::process::{LIMIT, Server, alone};

/// The limit of bytes per second over all links of a client, keep-alives included.
const AT_REST: u64 = 50;
/// The time over which bytes are counted: two heartbeats, and more keep-alives.
const STRETCH: Duration = Duration::from_secs(12);
/// The longest frame of the client.
const FRAME: Duration = Duration::from_millis(50);

/// Shows the world for a time. Returns the UDP bytes received meanwhile.
fn show(client: &mut ClientWorld, time: Duration) -> u64 {
    let (start, before) = (Instant::now(), client.traffic().udp_bytes_in);
    let mut last = f64::NEG_INFINITY;
    while start.elapsed() < time {
        let shown = client.view_time().map_or(last, |time| time.shown);
        assert!(shown >= last, "{shown} after {last}");
        last = shown;
        client.wait_update(client.updates(), FRAME);
    }
    client.traffic().udp_bytes_in - before
}

#[test]
fn a_world_at_rest_costs_a_client_fifty_bytes_per_second_in_all() {
    let _alone = alone();
    let server = Server::start(&["pyramid", "--set", "base=4", "--nodes", "1", "--regions", "1"]);
    let _node = server.node();
    let address = server.address.parse().unwrap();
    let mut client = ClientWorld::connect(&JoinConfig::new(address, server.token("client"))).unwrap();
    let deadline = Instant::now() + 2 * LIMIT;
    let rests = |client: &ClientWorld| {
        let is_awake = |view: &dcd::cluster::BodyView| {
            view.body.traits.kind == BodyKind::Dynamic && !view.body.state.sleeping
        };
        client.with_bodies(|view| is_awake(view).then_some(())).is_empty()
    };
    while !rests(&client) {
        assert!(Instant::now() < deadline, "the pyramid does not come to rest");
        show(&mut client, FRAME);
    }
    // Skips the first three heartbeats at rest, which follow more closely than later ones, and the comparison
    // of clocks.
    show(&mut client, Duration::from_secs(3));
    let (tick, bytes) = (client.tick(), show(&mut client, STRETCH));
    assert!(bytes <= AT_REST * STRETCH.as_secs(), "{bytes} bytes in {STRETCH:?}");
    println!("{:.1} bytes per second", bytes as f64 / STRETCH.as_secs_f64());
    assert!(client.tick().0 > tick.0 + 300, "it hears that time goes on");
    drop(client);
    server.stop();
}
