//! Gives the server and the client events that no honest process sends, and restores a server from entries
//! that no server has stored.

use std::time::Duration;

use dcd::cluster::directory::{Entry, Revision};
use dcd::cluster::{Client, ClientEvent, ClientOutput, Key, Server, ServerEvent, ServerOutput};
use dcd::protocol::decode;
use dcd::query::ShapeHash;
use dcd::space::GroupId;
use dcd::{Area, BodyId, ClientId, JointId, NodeId, Tick, Velocity};

use super::cluster::{points, server_config, world};
use super::nodes::check_said;
use super::script::{Event, Kind, events};

/// The most times in a row that a process may wake itself.
const MOST_WAKES: usize = 64;

/// Runs the server.
pub(super) fn server(script: &[u8]) {
    play_server(&mut Server::new(server_config(world(true)), points()), script);
}

/// Restores a server from stored entries, one per event, and lets it wait for its nodes.
pub(super) fn directory(script: &[u8]) {
    let entries = events(script).map(|event| entry(&event)).collect();
    if let Ok(mut server) = Server::restore(server_config(world(true)), entries) {
        let mut now = Duration::ZERO;
        for _ in 0..10 {
            now += Duration::from_millis(500);
            wake_server(now, &mut server);
        }
        check_server(&mut server);
    }
}

/// Returns the directory entry of an event. Its key stands for all keys of its kind; only groups, and what a
/// server tells nodes again, keep their ids.
fn entry(event: &Event<'_>) -> Entry {
    let (body, joint) = (BodyId::persistent(event.from.into()), JointId(event.from.into()));
    let key = match event.kind % 10 {
        0 => Key::World,
        1 => Key::Group(GroupId(event.from.into())),
        2 => Key::Body(BodyId::default()),
        3 => Key::Shape(ShapeHash([0; 16])),
        4 => Key::Joint(JointId(0)),
        5 => Key::GoneJoint(joint),
        6 => Key::GoneScenery(body),
        7 => Key::AlteredBody(body),
        8 => Key::AlteredJoint(joint),
        _ => Key::WokenBody(body),
    };
    Entry { key, revision: Revision::default(), value: event.bytes.to_vec() }
}

/// Returns the kind by which [`directory`] knows a key, and the id in that key.
#[must_use]
pub(super) fn kind_of(key: &Key) -> (u8, u8) {
    match key {
        Key::World => (0, 0),
        Key::Group(group) => (1, group.0 as u8),
        Key::Body(_) => (2, 0),
        Key::Shape(_) => (3, 0),
        Key::Joint(_) => (4, 0),
        Key::GoneJoint(joint) => (5, joint.0 as u8),
        Key::GoneScenery(body) => (6, body.index() as u8),
        Key::AlteredBody(body) => (7, body.index() as u8),
        Key::AlteredJoint(joint) => (8, joint.0 as u8),
        Key::WokenBody(body) => (9, body.index() as u8),
    }
}

fn play_server(server: &mut Server, script: &[u8]) {
    let mut now = Duration::ZERO;
    for event in events(script) {
        now += event.after();
        wake_server(now, server);
        let from = event.peer();
        match event.kind() {
            Kind::Said => {
                let Ok(message) = decode(event.bytes) else { continue };
                server.handle(now, ServerEvent::Message { from, message });
            }
            Kind::Disconnected => server.handle(now, ServerEvent::Disconnected(from)),
            Kind::Wanted => server.handle(now, wanted(&event)),
            Kind::Connected | Kind::Waited => {}
        }
        check_server(server);
    }
}

/// Returns an event that the server's operator may cause at any time.
fn wanted(event: &Event<'_>) -> ServerEvent {
    match event.bytes.len() % 4 {
        0 => ServerEvent::Save,
        1 => ServerEvent::SendAway {
            node: Some(NodeId(event.from.into())),
            client: None,
            reason: String::new(),
        },
        2 => ServerEvent::Suspend,
        _ => ServerEvent::Stop,
    }
}

fn wake_server(now: Duration, server: &mut Server) {
    for _ in 0..MOST_WAKES {
        if server.poll_timeout().is_none_or(|at| now < at) {
            return;
        }
        server.handle_timeout(now);
        check_server(server);
    }
    panic!("it is due at {:?}, however often it is woken at {now:?}", server.poll_timeout());
}

fn check_server(server: &mut Server) {
    while let Some(output) = server.poll_output() {
        if let ServerOutput::Send { message, .. } = output {
            check_said(&message);
        }
    }
}

/// Runs a client.
pub(super) fn client(script: &[u8]) {
    let (mut client, mut now) = (Client::new(ClientId(1), None, None), Duration::ZERO);
    for event in events(script) {
        now += event.after();
        wake_client(now, &mut client);
        let from = event.peer();
        match event.kind() {
            Kind::Said => {
                let Ok(message) = decode(event.bytes) else { continue };
                client.handle(now, ClientEvent::Message { from, message });
            }
            Kind::Connected => client.handle(now, ClientEvent::Connected(from)),
            Kind::Disconnected => client.handle(now, ClientEvent::Disconnected(from)),
            Kind::Waited => {}
            Kind::Wanted => {
                let body = BodyId::avatar(ClientId(1), 0);
                let (tick, velocity, pose) = (Tick(0), Velocity::default(), None);
                client.handle(now, ClientEvent::Input { body, tick, velocity, pose });
                let area = Area { centre: [event.from.into(), 0.0, 0.0], radius_m: 5.0 };
                client.handle(now, ClientEvent::Interest(Some(area)));
            }
        }
        check_client(&mut client);
        look_at(now, &mut client);
    }
}

/// Reads what a program reads in each frame.
fn look_at(now: Duration, client: &mut Client) {
    let _ = client.name_tick(now);
    if let Some(time) = client.view_time(now) {
        for view in client.bodies() {
            let _ = client.view(view.body.id, time.shown);
        }
    }
    client.take_touches().for_each(drop);
    client.take_handovers().for_each(drop);
}

fn wake_client(now: Duration, client: &mut Client) {
    for _ in 0..MOST_WAKES {
        if client.poll_timeout().is_none_or(|at| now < at) {
            return;
        }
        client.handle_timeout(now);
        check_client(client);
    }
    panic!("it is due at {:?}, however often it is woken at {now:?}", client.poll_timeout());
}

fn check_client(client: &mut Client) {
    while let Some(output) = client.poll_output() {
        if let ClientOutput::Send { message, .. } = output {
            check_said(&message);
        }
    }
}
