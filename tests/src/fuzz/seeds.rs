//! Makes inputs as honest processes send them: the messages of a small cluster, and files as dcd writes them.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use dcd::cluster::{NodeEvent, Peer, Record, ServerEvent};
use dcd::delta::{FreeMotion, Sender};
use dcd::net::{PROTOCOL_VERSION, Token};
use dcd::physics::ShapeLibrary;
use dcd::protocol::{
    Border, CodecError, Coupling, EnvironmentProperties, HeardBorder, Message, SharedState, Status,
    Testimony, ToClient, ViewNumber, decode, encode,
};
use dcd::recording::Recorder;
use dcd::runtime::{LocalWorld, PhysicsDevice, WorldConfig};
use dcd::sim::{StandIn, sim_body, sim_world};
use dcd::space::{DistributionTree, GroupId};
use dcd::{BodyId, Bounds, ClientId, Epoch, NodeId, Params, RegionId, Scene, Tick, Velocity, WorldPose};

use super::cluster::{Cluster, points, world};
use super::decoders::{is_config, loads};
use super::machines::kind_of;
use super::nodes::node_config;
use super::script::{Event, Kind, events, put, put_event};

const AVATAR: BodyId = BodyId::avatar(ClientId(1), 0);

/// Runs the story of a cluster: two nodes begin it, a client plays, a third node comes, a node dies, and the
/// world ends.
fn story(in_lockstep: bool) -> Cluster {
    let mut cluster = Cluster::new(world(in_lockstep), points(), || Box::<StandIn>::default());
    let ms = Duration::from_millis;
    cluster.start_node(1);
    cluster.start_node(2);
    cluster.run(ms(2_200));
    assert!(cluster.server().view().is_some(), "the world has begun");
    cluster.start_client();
    cluster.run(ms(50));
    cluster.spawn(sim_body(AVATAR, [8.0, 4.0, 4.0]));
    cluster.run(ms(60));
    cluster.steer(AVATAR, [3.0, 0.0, 0.0]);
    cluster.run(ms(60));
    cluster.start_node(3);
    cluster.run(ms(2_200));
    assert_eq!(cluster.refused(), 0, "all are honest");
    cluster.kill(2);
    cluster.run(ms(1_500));
    cluster.command(ServerEvent::Stop);
    cluster.run(ms(200));
    cluster
}

/// Returns the first 40, 120, 400 and 1,200 events of a script, each as a script. Short inputs are mutated
/// more thoroughly.
fn parts(script: &[u8]) -> Vec<Vec<u8>> {
    let all: Vec<_> = events(script).collect();
    [40, 120, 400, 1_200]
        .into_iter()
        .take_while(|count| *count < 2 * all.len())
        .map(|count| {
            let mut part = Vec::new();
            all.iter().take(count).for_each(|event| put_event(&mut part, event));
            part
        })
        .collect()
}

fn of(who: Peer) -> Vec<Vec<u8>> {
    [true, false].into_iter().flat_map(|in_lockstep| parts(&story(in_lockstep).script(who))).collect()
}

pub(super) fn servers() -> Vec<Vec<u8>> {
    parts(&story(true).script(Peer::Server))
}

pub(super) fn clients() -> Vec<Vec<u8>> {
    of(Peer::Client(ClientId(1)))
}

pub(super) fn leaders() -> Vec<Vec<u8>> {
    of(Peer::Node(NodeId(1)))
}

pub(super) fn members() -> Vec<Vec<u8>> {
    of(Peer::Node(NodeId(2)))
}

/// Returns messages of every kind that the processes of the story exchange, some of each.
pub(super) fn messages() -> Vec<Vec<u8>> {
    let cluster = story(true);
    let everybody = [Peer::Server, Peer::Client(ClientId(1)), Peer::Node(NodeId(1)), Peer::Node(NodeId(2))];
    let mut known = std::collections::BTreeMap::<Vec<u8>, usize>::new();
    let mut messages = Vec::new();
    for script in everybody.map(|who| cluster.script(who)) {
        for event in events(&script).filter(|event| event.kind() == Kind::Said) {
            // The kind is the message's variant, mostly with the variant of its content.
            let kind = event.bytes.iter().take(2).copied().collect();
            let count = known.entry(kind).or_default();
            *count += 1;
            if *count <= 2 && decode(event.bytes).is_ok() {
                messages.push(event.bytes.to_vec());
            }
        }
    }
    messages.extend(of_verification());
    messages.extend(by_hand());
    messages.extend(kinds().into_iter().filter_map(|kind| shortest(&kind)));
    messages
}

/// Returns the messages that members send to verify participants.
fn of_verification() -> Vec<Vec<u8>> {
    let (view, tick) = (ViewNumber(3), Tick(9));
    let heard = |from| HeardBorder { round: 1, from: NodeId(from), digest: 0x0123_4567_89ab_cdef << from };
    let border = Border { view, tick, round: 1, messages: Vec::new() };
    let messages = [
        Message::Testimony(Testimony { view, tick, heard: (1..4).map(heard).collect() }),
        Message::Copied { to: NodeId(2), border },
    ];
    messages.iter().map(encode).collect()
}

/// Returns messages that no process of the story sends, and that are not valid with zeros alone.
fn by_hand() -> Vec<Vec<u8>> {
    let tree = DistributionTree::halved(Bounds::around([0.0; 3], [8.0; 3]), 2).expect("two regions");
    let body = sim_body(BodyId::persistent(7), [1.0; 3]);
    let status = Status {
        tick: Tick(9),
        heard_ms: 250,
        dt_s: 1.0 / 60.0,
        bodies: 1,
        clients: 1,
        main: GroupId::default(),
        groups: Vec::new(),
        nodes: Vec::new(),
    };
    let of_client = [
        ToClient::Regions { tree, allocation: BTreeMap::new() },
        ToClient::Inserted { body, shapes: Vec::new(), joints: Vec::new() },
    ];
    let of_client = of_client.map(|message| Message::ToClient(ClientId(1), message));
    of_client.iter().chain([&Message::Status(status)]).map(encode).collect()
}

/// Returns the first bytes of messages of all kinds: the variant, and in envelopes also the variant of the
/// content. In two envelopes the id of a client comes between the two.
fn kinds() -> Vec<Vec<u8>> {
    const ENVELOPES: [&[u8]; 4] = [&[TO_NODE], &[TO_SERVER], &[FROM_CLIENT, 1], &[TO_CLIENT, 1]];
    let is_variant = |kind: &Vec<u8>| match decode(kind) {
        Err(CodecError::Malformed(error)) => !format!("{error:?}").contains("UnexpectedVariant"),
        _ => true,
    };
    let variants = |envelope: &[u8]| -> Vec<Vec<u8>> {
        (0..u8::MAX).map(|variant| [envelope, &[variant]].concat()).take_while(is_variant).collect()
    };
    let mut kinds = variants(&[]);
    kinds.retain(|kind| ENVELOPES.iter().all(|envelope| envelope[0] != kind[0]));
    kinds.extend(ENVELOPES.into_iter().flat_map(variants));
    kinds
}

const TO_NODE: u8 = 1;
const TO_SERVER: u8 = 2;
const FROM_CLIENT: u8 = 8;
const TO_CLIENT: u8 = 9;

/// Returns the shortest message that continues these first bytes with zeros alone, if there is one.
fn shortest(kind: &[u8]) -> Option<Vec<u8>> {
    (0..600).map(|zeros| [kind, &vec![0; zeros]].concat()).find(|bytes| decode(bytes).is_ok())
}

pub(super) fn directories() -> Vec<Vec<u8>> {
    let mut cluster = story(true);
    let mut script = Vec::new();
    for entry in cluster.stored() {
        let (kind, from) = kind_of(&entry.key);
        put_event(&mut script, &Event { kind, from, after_ms: 0, bytes: &entry.value });
    }
    vec![script]
}

/// Returns boxes in stacks, on both sides of every border.
fn boxes(coupling: Coupling) -> (EnvironmentProperties, Record) {
    let scene =
        Scene::named("pile", &Params::new().with("n", 9).with("height", 3)).expect("it is in the library");
    let mut shapes = ShapeLibrary::default();
    let (bodies, joints) = scene.records(&mut shapes).expect("its shapes can be built");
    let bounds = Bounds::around([0.75, 2.5, 0.75], [4.0; 3]);
    let tree = DistributionTree::halved(bounds, 4).expect("four regions");
    let mut step = scene.step_settings().record();
    step.coupling = coupling;
    let world = EnvironmentProperties { step, tree, halo_m: None, ..sim_world(1) };
    (world, Record::new(bodies, shapes.records(), joints))
}

/// Returns the events of a member of a group that computes boxes: until its first view began, and after.
fn computing() -> (Vec<u8>, Vec<u8>) {
    let (world, record) = boxes(Coupling::Auto);
    let mut cluster = Cluster::new(world, record, || Box::new(PhysicsDevice::new(1)));
    cluster.start_node(1);
    cluster.start_node(2);
    let who = Peer::Node(NodeId(2));
    while cluster.server().view().is_none() {
        cluster.run(Duration::from_millis(1));
    }
    let beginning = cluster.script(who);
    cluster.run(Duration::from_millis(500));
    let after = cluster.script(who).split_off(beginning.len());
    (beginning, after)
}

pub(super) fn beginning_of_device() -> Vec<u8> {
    computing().0
}

pub(super) fn devices() -> Vec<Vec<u8>> {
    let after = computing().1;
    // If no other member takes part, no border messages are sent.
    parts(&after).into_iter().take(2).collect()
}

/// Returns datagrams of states that refer to earlier ones.
pub(super) fn states() -> Vec<Vec<u8>> {
    let mut sender = Sender::new(FreeMotion::of(&sim_world(1).step), 0);
    let mut script = Vec::new();
    for tick in 0..20 {
        let state = |index: u32| SharedState {
            id: BodyId::persistent(index),
            owner: RegionId(1),
            epoch: Epoch(1),
            pose: WorldPose::at([f64::from(index), tick as f64 / 10.0, 3.0]),
            velocity: Velocity { linear: [0.0, 6.0, index as f32], angular: [0.0; 3] },
            sleeping: index == 3,
        };
        let states: Vec<_> = (0..5).map(state).collect();
        for part in sender.pack(Tick(tick), Tick(tick), &states, false, 1_000) {
            put(&mut script, Kind::Said, Peer::Server, Duration::from_millis(16), &part.states);
        }
    }
    vec![script]
}

/// Returns requests to join and to renew, and their answers, as far as their form goes.
pub(super) fn joining() -> Vec<Vec<u8>> {
    let counted = |field: &[u8]| [&(field.len() as u16).to_be_bytes()[..], field].concat();
    let token = "dcd1-aaaa";
    let (version, key, proof) = (PROTOCOL_VERSION.to_be_bytes(), [7; 32], counted(&[9; 64]));
    let join = [b"join", &version[..], &counted(token.as_bytes()), &key, &proof, &counted(b"")].concat();
    let renew = [b"renw", &version[..], &counted(&[48, 130, 1, 2]), &key, &proof].concat();
    let ids = [&[1, 2][..], &1_u32.to_be_bytes(), &0_u32.to_be_bytes(), &9_u64.to_be_bytes()].concat();
    let admitted = [&ids[..], &counted(&[1; 40]), &counted(&[2; 40]), &counted(b"dcdk-aaaa")].concat();
    let refused = [&[0][..], b"the token was used"].concat();
    vec![join, renew, admitted, refused, token_text()]
}

/// Returns a token as a server's authority mints it.
fn token_text() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let authority = dcd::net::Authority::load_or_create(folder.path()).expect("a new authority");
    let token: Token = authority
        .issue_token(dcd::net::JoinRole::Node, Duration::from_secs(60), std::time::SystemTime::now())
        .expect("a token");
    token.to_string().into_bytes()
}

/// Returns scene files with most tables.
pub(super) fn scenes() -> Vec<Vec<u8>> {
    let all = r#"
[world]
name = "all"
gravity = [0.0, -9.81, 0.0]
bounds = { min = [-20.0, 0.0, -14.0], max = [20.0, 8.0, 14.0] }
regions = 2
[avatar]
position = [-6.0, 0.61, 2.0]
mass = 12.0
[[body]]
name = "ground"
kind = "fixed"
[[body.collider]]
shape = "box"
half_size = [20.0, 0.5, 14.0]
position = [0.0, -0.5, 0.0]
[[body]]
name = "ball"
position = [0.0, 3.0, 0.0]
[[body.collider]]
shape = "sphere"
radius = 0.5
[[grid]]
count = [2, 1, 2]
spacing = [2.0, 2.0, 2.0]
[grid.body]
position = [3.0, 1.0, 0.0]
[[grid.body.collider]]
shape = "box"
half_size = [0.5, 0.5, 0.5]
[[joint]]
kind = "spherical"
a = "ground"
b = "ball"
"#;
    let library = "[library]\nscene = \"pile\"\nparams = { n = 3 }\n";
    let playground = include_str!("../../../dcd/scenes/playground.toml");
    let all: Vec<Vec<u8>> = vec![all.into(), library.into(), playground.into()];
    all.iter().for_each(|text| assert!(loads("scene.toml", text), "a seed is a scene"));
    all
}

/// Returns models in both formats.
pub(super) fn models() -> Vec<Vec<u8>> {
    let mjcf = r#"<mujoco><option timestep="0.01"/><worldbody><geom type="plane" size="5 5 .1"/>
<body name="a" pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/>
<body name="b" pos="0 0 .3"><joint name="j" type="hinge" axis="0 1 0" range="-45 45"/><geom type="capsule" size=".05 .1"/></body></body>
</worldbody><actuator><motor joint="j" gear="2"/></actuator></mujoco>"#;
    let urdf = r#"<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="b"><collision><geometry><cylinder radius=".1" length="1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
    assert!(loads("model.xml", mjcf.as_bytes()) && loads("model.urdf", urdf.as_bytes()), "seeds are models");
    vec![mjcf.into(), urdf.into()]
}

pub(super) fn snapshots() -> Vec<Vec<u8>> {
    let mut bytes = Vec::new();
    LocalWorld::new(WorldConfig::default())
        .expect("a world")
        .save(&mut bytes)
        .expect("memory can be written");
    vec![bytes]
}

/// A file in memory with several owners.
#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Vec<u8>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("nobody panics").write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Returns the recording of a member of the story.
pub(super) fn recordings() -> Vec<Vec<u8>> {
    let file = Shared::default();
    let mut recorder = Recorder::of_node(file.clone(), &node_config(NodeId(2)), true).expect("memory");
    let script = story(true).script(Peer::Node(NodeId(2)));
    let mut now = Duration::ZERO;
    for event in events(&script).take(60) {
        now += event.after();
        let from = event.peer();
        match (event.kind(), decode(event.bytes)) {
            (Kind::Said, Ok(message)) => recorder.node_event(now, &NodeEvent::Message { from, message }),
            (Kind::Connected, _) => recorder.node_event(now, &NodeEvent::Connected(from)),
            _ => recorder.node_timeout(now),
        }
    }
    recorder.finish().expect("memory can be written");
    let bytes = file.0.lock().expect("nobody panics").clone();
    vec![bytes]
}

/// Returns the delays of some nodes, and the course of some votes.
pub(super) fn rules() -> Vec<Vec<u8>> {
    let delays = (0..200_u32).map(|i| (i * 37 % 251) as u8);
    let formed = [6, 20, 0].into_iter().chain(delays).collect();
    let held = [
        [0, 1, 0, 0],
        [7 | 1 << 3, 0b1110, 0b1110, 2],
        [7 | 3 << 3, 0b1110, 0b1110, 2],
        [4, 1, 1, 9],
        [4, 3, 65, 9],
        [3, 0, 0, 255],
    ];
    vec![formed, held.concat()]
}

/// Returns requests as browsers and Prometheus send them, and a stream with each of the messages that a page
/// sends.
pub(super) fn pages() -> Vec<Vec<u8>> {
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:4000\r\n\r\n").into_bytes();
    let mut pages: Vec<_> = ["/", "/view.js?key=key", "/metrics"].map(get).to_vec();
    let head = b"GET /stream?key=key HTTP/1.1\r\nHost: 127.0.0.1:4000\r\nOrigin: http://127.0.0.1:4000\r\nUpgrade: websocket\r\n\
        Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
    let kinds = 1..=9_u8;
    let mut stream = head.to_vec();
    for kind in kinds.clone() {
        let number = if kind == 5 { 2.0_f64.to_le_bytes() } else { u64::from(kind).to_le_bytes() };
        // A binary frame of nine bytes, masked with zeros.
        stream.extend([0x82, 0x80 | 9, 0, 0, 0, 0, kind]);
        stream.extend(number);
    }
    assert_eq!(dcd::read_browser(&stream), kinds.count(), "all messages of a page are understood");
    pages.push(stream);
    pages
}

/// Returns the files of options that dcd ships, and one with options of each kind.
pub(super) fn configs() -> Vec<Vec<u8>> {
    let text = "scene = \"tower\"\nnodes = 2\nunpaced = true\nset = [\"n=3\", \"mass=2\"]\ndata = \"folder\"\nlog-format = \"json\"\nverbose = 2\n";
    let files =
        [include_str!("../../../packaging/server.toml"), include_str!("../../../packaging/node.toml"), text];
    let files = files.map(|text| text.as_bytes().to_vec());
    files.iter().for_each(|file| assert!(is_config(file), "{}", String::from_utf8_lossy(file)));
    files.to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_message_has_a_seed() {
        let (seeds, kinds) = (messages(), kinds());
        assert!(kinds.len() > 60, "{} kinds", kinds.len());
        let without: Vec<_> =
            kinds.iter().filter(|kind| !seeds.iter().any(|seed| seed.starts_with(kind))).collect();
        assert!(without.is_empty(), "no seed begins as {without:?}: add messages of these kinds");
    }
}
