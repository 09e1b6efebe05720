//! C programs in a world that a server of this process holds and two nodes of this process compute.

use std::process::Command;
use std::time::Duration;

use dcd::net::Role;
use dcd::protocol::Pace;
use dcd::runtime::{JoinConfig, Member, MemberConfig, Partitioning, ServeConfig, ServerProcess, WorldConfig};
use dcd::scene::{Params, Scene};

use crate::toolchain::{build, root, run_well};

const LIMIT: Duration = Duration::from_secs(60);

struct Cluster {
    server: ServerProcess,
    nodes: Vec<Member>,
    folder: tempfile::TempDir,
}

impl Cluster {
    /// A pile of boxes in two regions.
    fn start(nodes: usize) -> Self {
        let scene = Scene::named("pile", &Params::new().with("n", 100)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let server = ServerProcess::start(
            &scene,
            ServeConfig {
                listen: "127.0.0.1:0".parse().unwrap(),
                data: folder.path().join("server"),
                world: WorldConfig {
                    partitioning: Partitioning::Regions(2),
                    ..WorldConfig::for_scene(&scene)
                },
                nodes,
                pace: Pace::RealTime,
                last_tick: None,
                avatar_speed_limit: 20.0,
            },
        )
        .unwrap();
        let nodes = (0..nodes)
            .map(|_| {
                let token = server.token(Role::Node, LIMIT).unwrap();
                let identity = JoinConfig::new(server.address, token).join(Role::Node).unwrap();
                Member::start(MemberConfig::new(server.address, identity)).unwrap()
            })
            .collect();
        Self { server, nodes, folder }
    }

    fn token(&self, role: Role) -> String {
        self.server.token(role, LIMIT).unwrap()
    }

    /// The world must have come through it whole.
    fn stop(self) {
        let summary = self.server.stop();
        assert_eq!((summary.lost, summary.doubled), (0, 0));
        for node in self.nodes {
            node.finish().unwrap();
        }
    }
}

#[test]
fn join_drives_an_avatar_through_towers_and_hears_of_contacts() {
    let cluster = Cluster::start(2);
    let program = build(&root().join("examples-c/join.c"), cluster.folder.path(), &[]);
    let mut join = Command::new(program);
    join.arg(cluster.server.address.to_string()).arg(cluster.token(Role::Client));
    let said = run_well(join.args(["2", "-12", "1", "0.75", "10", "0", "0"]));
    let last = said.lines().last().expect("it says something");
    let value = |name: &str| -> f64 {
        let rest = last.split(&format!("{name}=")).nth(1).unwrap_or_else(|| panic!("{said}"));
        rest.split(' ').next().and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{said}"))
    };
    assert!(last.starts_with("join: updates="), "{said}");
    assert!(value("updates") > 5.0 && value("contacts") > 0.0, "{said}");
    assert!((5.0..25.0).contains(&value("moved_m")), "{said}");
    assert_eq!(value("bodies"), 101.0, "{said}");
    cluster.stop();
}
