//! Tests that forbidden requests of hostile clients over real QUIC are refused, and counted by their cause in
//! the process that refused them.

use std::time::Duration;

use dcd::net::{JoinRole, Lane, Limits, Net, NetConfig, NetEvent, PeerName};
use dcd::protocol::{self, BuildOp, FromClient, Message, Refusal, Velocity, WorldPose};
use dcd::runtime::{ClientWorld, JoinConfig};
use dcd::space::{BodyId, NodeId};
use dcd_tests::proxy::free_address;

use crate::metrics::{address, scrape, wait};
use crate::process::{LIMIT, Server, playground};

/// Returns how many requests a process has refused for this cause, from its `/metrics`.
fn rejections(address: &str, cause: &str) -> f64 {
    scrape(address)[&format!("dcd_rejections_total{{cause=\"{cause}\"}}")]
}

/// Waits for the next refusal.
fn refusal(client: &ClientWorld) -> (Option<BodyId>, Refusal) {
    wait("it is refused", || {
        client.check().unwrap();
        client.wait_update(client.updates(), Duration::from_millis(5));
        client.take_events().refusals.pop()
    })
}

#[test]
fn what_a_client_may_not_is_counted_by_its_cause_where_it_is_refused() {
    let scene = playground();
    let mut server = Server::start(&[scene.to_str().unwrap(), "--nodes", "1", "--metrics", "127.0.0.1:0"]);
    let of_server = address(&mut server.process);
    let node_address = free_address();
    let (_, mut node) =
        server.node_with(&["--listen", &node_address.to_string(), "--metrics", "127.0.0.1:0"]);
    let of_node = address(&mut node);
    let mut witness = server.witness();
    let counts = || ["input", "forbidden", "violation", "malformed"].map(|cause| rejections(&of_node, cause));
    let before = (counts(), rejections(&of_server, "input"));
    assert_eq!(before, ([0.0; 4], 0.0), "an honest client is refused nothing");

    // A ClientWorld does not check its inputs: first too fast, then too far.
    let avatar = witness.avatar;
    let fast = Velocity { linear: [1e4, 0.0, 0.0], angular: [0.0; 3] };
    witness.world.send_input(avatar, fast, None).unwrap();
    assert_eq!(refusal(&witness.world), (Some(avatar), Refusal::TooFast));
    wait("it is counted", || (rejections(&of_node, "input") == 1.0).then_some(()));
    let far = WorldPose::at([1e4, 20.0, 0.0]);
    witness.world.send_input(avatar, Velocity::default(), Some(far)).unwrap();
    assert_eq!(refusal(&witness.world), (Some(avatar), Refusal::TooFar));
    wait("it is counted", || (rejections(&of_node, "input") == 2.0).then_some(()));
    // An input for a future avatar waits, but this avatar does not come.
    let nobody = BodyId::avatar(witness.world.id(), 900);
    witness.world.send_input(nobody, Velocity::default(), None).unwrap();
    assert_eq!(refusal(&witness.world), (Some(nobody), Refusal::Unknown));
    wait("it is counted", || (rejections(&of_node, "input") == 3.0).then_some(()));
    assert_eq!(rejections(&of_server, "input"), 0.0, "its leader refused it");

    // Requests to build go to the server, which answers.
    let body =
        witness.world.with_bodies(|view| Some(view.body.id)).into_iter().find(|id| id.client().is_none());
    let body = body.expect("the scene has bodies");
    witness.world.build(vec![BuildOp::Remove(body)]).unwrap();
    assert_eq!(refusal(&witness.world), (None, Refusal::MayNotBuild));
    wait("it is counted", || (rejections(&of_server, "input") == 1.0).then_some(()));

    // A node does not take such requests, whoever sends them.
    let server_address = server.address.parse().unwrap();
    let identity = JoinConfig::new(server_address, server.token("client")).join(JoinRole::Client).unwrap();
    let client = identity.client().unwrap();
    let (listen, limits) = ("127.0.0.1:0".parse().unwrap(), Limits::default());
    let config = NetConfig { listen, identity, authority: None, renewed_by: Vec::new(), limits };
    let (net, events) = Net::start(config).unwrap();
    let link = net.connect(node_address, PeerName::Node(NodeId(1)));
    let event = events.recv_timeout(LIMIT).unwrap();
    assert!(matches!(event, NetEvent::Connected { peer, .. } if peer == link), "{event:?}");
    let build = FromClient::Build { number: 1, ops: vec![BuildOp::Remove(body)] };
    let build = protocol::encode(&Message::FromClient(client, build));
    for asked in 1..=3 {
        net.send(link, Lane::Client, &build).unwrap();
        wait("it is counted", || (rejections(&of_node, "forbidden") == f64::from(asked)).then_some(()));
    }
    assert_eq!(counts(), [3.0, 3.0, 0.0, 0.0]);
    assert!(witness.world.body(body).is_some(), "nothing was removed");
    net.shutdown();
    witness.leave();
    server.stop();
}
