//! Tests that real nodes share a world out anew: where its load gathers in a corner, where a node is slow, and as
//! one node becomes eight and eight become one.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::process::{Process, Server, alone, dcd, signal};

/// A time that nothing here comes near.
const LONG: Duration = Duration::from_secs(90);
/// The number of balls of the crowd.
const BALLS: u64 = 576;
/// The times for which a slow node is stopped, and then runs: a sixteenth of all.
const STOPPED: Duration = Duration::from_millis(30);
const RUNS: Duration = Duration::from_millis(2);

/// Serves balls that fly side by side without touching. They slow down until they are twice the velocity
/// farther than they began.
fn crowd(velocity: [f32; 3]) -> Server {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("crowd.toml");
    let text = format!(
        "[world]\ngravity = [0, 0, 0]\nbounds = {{ min = [-48, -8, -48], max = [48, 8, 48] }}\n\
         [[grid]]\ncount = [24, 1, 24]\nspacing = [1.3, 0, 1.3]\n\
         [grid.body]\nposition = [-15, 0, -15]\nvelocity = {velocity:?}\nlinear_damping = 0.5\ncan_sleep = false\n\
         [[grid.body.collider]]\nshape = \"sphere\"\nradius = 0.3\n"
    );
    std::fs::write(&scene, text).unwrap();
    Server::start(&[scene.to_str().unwrap()])
}

fn status(server: &Server) -> Value {
    let mut command = dcd(&["status", "--json", "--server", &server.address, "--data"]);
    let ended = Process::start(command.arg(server.data())).end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    ended.json()
}

/// Waits until the world is past a tick and so many nodes have as many bodies as `is_right` wants, by their
/// names. They must have all balls together.
fn wait(server: &Server, tick: u64, nodes: usize, is_right: impl Fn(&[(String, f64)]) -> bool) {
    let start = Instant::now();
    loop {
        let told = status(server);
        let of = |node: &Value| (node["node"].as_str().unwrap().to_owned(), node["bodies"].as_f64().unwrap());
        let bodies: Vec<_> = told["nodes"].as_array().unwrap().iter().map(of).collect();
        let all: f64 = bodies.iter().map(|(_, bodies)| bodies).sum();
        let is_whole = all == BALLS as f64 && bodies.len() == nodes;
        if told["tick"].as_u64().unwrap() >= tick && is_whole && is_right(&bodies) {
            return;
        }
        assert!(start.elapsed() < LONG, "{told}");
    }
}

/// Returns whether no node has more than 1.3 times the mean.
fn is_even(bodies: &[(String, f64)]) -> bool {
    let most = bodies.iter().map(|(_, bodies)| *bodies).fold(0.0, f64::max);
    most <= 1.3 * BALLS as f64 / bodies.len() as f64
}

#[test]
fn a_world_that_gathers_in_a_corner_is_shared_out_among_its_nodes() {
    let _alone = alone();
    let server = crowd([8.0, 0.0, 8.0]);
    let _nodes = [(); 4].map(|()| server.node());
    // After six seconds 95 % of the way is flown: all balls are beyond both planes through the middle.
    wait(&server, 360, 4, is_even);
    let served = server.stop();
    assert_eq!(served["bodies"], BALLS);
    assert!(served["repartitions"].as_u64().unwrap() > 1, "{served}");
}

#[test]
#[ignore = "takes half a minute"]
fn a_node_that_is_slow_for_a_while_gets_less_to_do_meanwhile() {
    let _alone = alone();
    let server = crowd([0.0; 3]);
    let nodes = [(); 3].map(|()| server.node());
    wait(&server, 60, 3, is_even);
    let (slow, id) = (&nodes[1].0, nodes[1].1.id());
    let (over, is_over) = mpsc::channel::<()>();
    std::thread::scope(|threads| {
        // Dropped here whatever happens, so that the node is stopped no more.
        let _over = over;
        threads.spawn(move || {
            loop {
                signal(id, "-STOP");
                std::thread::sleep(STOPPED);
                signal(id, "-CONT");
                if is_over.recv_timeout(RUNS) != Err(RecvTimeoutError::Timeout) {
                    break;
                }
            }
        });
        wait(&server, 0, 3, |bodies| {
            bodies.iter().any(|(node, bodies)| node == slow && *bodies < BALLS as f64 / 3.0 / 4.0)
        });
    });
    wait(&server, 0, 3, is_even);
    assert_eq!(server.stop()["bodies"], BALLS);
}

#[test]
#[ignore = "takes half a minute"]
fn one_node_becomes_eight_and_these_become_one() {
    let _alone = alone();
    let server = crowd([4.0, 0.0, 4.0]);
    let mut nodes = vec![server.node()];
    wait(&server, 0, 1, |_| true);
    nodes.extend([(); 7].map(|()| server.node()));
    wait(&server, 0, 8, is_even);
    // Half of them are asked to leave, and the others die. The first, which leads, is among those.
    for (number, (name, mut node)) in nodes.drain(..7).enumerate() {
        if number % 2 == 0 {
            node.kill();
        } else {
            node.interrupt();
            assert_eq!(node.end().code(), Some(130), "{name}");
        }
        wait(&server, 0, 7 - number, |bodies| bodies.iter().all(|(_, bodies)| *bodies > 0.0));
    }
    assert_eq!(server.stop()["bodies"], BALLS);
}
