//! Tests processes of different versions: they refuse each other, and both ends name both versions.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use dcd::net::{Authority, Identity, JoinRole, Lane, Limits, Net, NetConfig, NetEvent, NetEvents, PeerName};
use dcd::protocol::{self, Farewell, Hello, JoinAs, Message, Refusal, ToNode, VERSION};
use dcd::runtime::JoinConfig;

use crate::process::{LIMIT, Process, Server, dcd};

fn start(identity: Identity, authority: Option<Arc<Authority>>) -> (Net, NetEvents) {
    let listen = "127.0.0.1:0".parse().unwrap();
    let renewed_by = Vec::new();
    Net::start(NetConfig { listen, identity, authority, renewed_by, limits: Limits::default() }).unwrap()
}

/// Sends a server this greeting, and returns why the server refuses the node.
fn refusal(server: &Server, greeting: &[u8]) -> String {
    let address: SocketAddr = server.address.parse().unwrap();
    let identity = JoinConfig::new(address, server.token("node")).join(JoinRole::Node).unwrap();
    let (net, events) = start(identity, None);
    let link = net.connect(address, PeerName::Server);
    loop {
        match events.recv_timeout(LIMIT).expect("the server answers") {
            NetEvent::Connected { .. } => net.send(link, Lane::Admin, greeting).unwrap(),
            NetEvent::Closed { reason, .. } => return reason,
            _ => {}
        }
    }
}

#[test]
fn a_server_refuses_a_node_of_another_version_and_both_are_told_both_versions() {
    let server = Server::start(&["tower"]);
    let role = JoinAs::Node { address: "127.0.0.1:9".parse().unwrap(), client: None, resume: None, heard: 0 };
    let before = Message::Hello(Hello { version: VERSION - 1, role });
    // A version with another form of greeting.
    let after = [protocol::encode_value(&(0_u32, VERSION + 1)), vec![250; 9]].concat();
    for (greeting, theirs) in [(protocol::encode(&before), VERSION - 1), (after, VERSION + 1)] {
        let reason = refusal(&server, &greeting);
        let names = |version: u32| {
            reason.split(|letter: char| !letter.is_ascii_digit()).any(|word| word == version.to_string())
        };
        assert!(
            names(theirs) && names(VERSION) && reason.contains("install the same dcd on both"),
            "{reason}"
        );
    }
    server.process.interrupt();
    let ended = server.process.end();
    for theirs in [VERSION - 1, VERSION + 1] {
        let named =
            |line: &str| line.contains(&format!("version {theirs}")) && line.contains(&VERSION.to_string());
        assert!(ended.errors.lines().any(named), "the server's log: {ended:?}");
    }
}

#[test]
fn a_node_that_a_server_of_another_version_refuses_ends_and_says_both_versions() {
    let folder = tempfile::tempdir().unwrap();
    let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
    let (net, events) = start(authority.server_identity().unwrap(), Some(authority.clone()));
    let token = authority.issue_token(JoinRole::Node, Duration::from_secs(60), SystemTime::now()).unwrap();
    let address = net.local_addr().to_string();
    let node = Process::start(&mut dcd(&["node", "--server", &address, "--token", &token.to_string()]));
    loop {
        if let NetEvent::Frame { peer, bytes, .. } = events.recv_timeout(LIMIT).expect("the node greets") {
            let Ok(Message::Hello(hello)) = protocol::decode(&bytes) else { continue };
            let reason = Refusal::Version { theirs: hello.version, ours: VERSION + 1 }.to_string();
            let farewell = Message::ToNode(ToNode::Shutdown { farewell: Farewell::Refused, reason });
            net.send(peer, Lane::Admin, protocol::encode(&farewell)).unwrap();
            break;
        }
    }
    let ended = node.end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    let said = format!("protocol version {VERSION} does not match the server's {}", VERSION + 1);
    assert!(ended.errors.contains(&said), "{ended:?}");
}

#[test]
fn a_status_that_cannot_be_read_is_no_silence() {
    let folder = tempfile::tempdir().unwrap();
    let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
    let (net, events) = start(authority.server_identity().unwrap(), Some(authority.clone()));
    let token = authority.issue_token(JoinRole::Client, Duration::from_secs(60), SystemTime::now()).unwrap();
    let address = net.local_addr().to_string();
    let status = Process::start(&mut dcd(&["status", "--server", &address, "--token", &token.to_string()]));
    loop {
        if let NetEvent::Frame { peer, .. } = events.recv_timeout(LIMIT).expect("it asks") {
            net.send(peer, Lane::Admin, [250, 250]).unwrap();
            break;
        }
    }
    let ended = status.end();
    assert!(ended.code() == Some(1) && ended.errors.contains("install the same dcd on both"), "{ended:?}");
}
