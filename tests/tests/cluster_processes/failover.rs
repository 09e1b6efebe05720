//! Tests standby servers of a world that is kept in a real etcd: the active server, and members of etcd, are
//! killed with kill -9 and stopped.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use dcd::runtime::ClientWorld;
use dcd_tests::etcd::{Certified, EtcdCluster};
use dcd_tests::proxy::free_address;

use crate::process::{Process, alone, dcd, playground, token};
use crate::witness::{Witness, joining};

/// The longest time that a world with healthy nodes may stand still, on a busy machine.
const PAUSE: Duration = Duration::from_secs(1);
/// The longest time until joins work again.
const TAKEOVER: Duration = Duration::from_secs(3);

/// The arguments of `dcd serve` that name a world, and its number of bodies.
type World = (&'static [&'static str], u64);
const PLAYGROUND: World = (&[concat!(env!("CARGO_MANIFEST_DIR"), "/../dcd/scenes/playground.toml")], 155);
/// A thousand cubes that never rest.
const CROWD: World = (&["dve", "--set", "n=1000"], 1_000);

/// Two servers of one world, of which one is active, two nodes, a client that watches and one that plays.
struct Pair {
    etcd: EtcdCluster,
    served: World,
    /// The address of the world in etcd.
    place: String,
    folder: tempfile::TempDir,
    addresses: [String; 2],
    /// The servers by their number; `None` for one that has ended.
    servers: [Option<Process>; 2],
    active: usize,
    nodes: Vec<Process>,
    player: Process,
    witness: Witness,
}

impl Pair {
    /// Starts the processes. Returns `None` where etcd is not installed.
    fn start(members: usize) -> Option<Self> {
        let etcd = EtcdCluster::start(members)?;
        let place = etcd.place("play");
        Some(Self::start_at(place, etcd, PLAYGROUND))
    }

    fn start_at(place: String, etcd: EtcdCluster, served: World) -> Self {
        let folder = tempfile::tempdir().unwrap();
        // A standby server has no port yet, but other processes need to know it.
        let addresses = [(); 2].map(|()| free_address().to_string());
        let data = folder.path().join("0");
        let mut active = serve(served, &place, &addresses[0], &data);
        active.line("listening ");
        let mut standby = serve(served, &place, &addresses[1], &folder.path().join("1"));
        let holder = standby.line("standing by for ");
        assert!(holder.starts_with(&addresses[0]) && holder.contains(" on "), "{holder}");
        let both = addresses.join(",");
        let join = |role: &str, args: &[&str]| {
            let mut process =
                Process::start(dcd(args).args(["--server", &both, "--token", &token(&data, role)]));
            process.line("joined as ");
            process
        };
        let node = ["node", "--json", "--threads", "1"];
        let nodes = vec![join("node", &node), join("node", &node)];
        assert!(active.line("view ").contains("n1 r1, n2 r2"));
        let player = join("client", &["client", "--json", "--avatars", "10"]);
        let witness = Witness::join(&both, token(&data, "client"));
        let servers = [Some(active), Some(standby)];
        Self { etcd, served, place, folder, addresses, servers, active: 0, nodes, player, witness }
    }

    fn data(&self, server: usize) -> PathBuf {
        self.folder.path().join(server.to_string())
    }

    fn both(&self) -> String {
        self.addresses.join(",")
    }

    fn active(&mut self) -> &mut Process {
        self.servers[self.active].as_mut().expect("it runs")
    }

    /// Watches until the standby server admits a new client and has both nodes as members. Returns the time
    /// until the client was admitted, and the longest time that the world stood still.
    fn take_over(&mut self) -> Takeover {
        let start = Instant::now();
        self.active = 1 - self.active;
        let (both, data) = (self.both(), self.data(self.active));
        // The standby server's folder has the authority from etcd, so it can mint tokens.
        let join = move || drop(ClientWorld::connect(&joining(&both, token(&data, "client"))).unwrap());
        let joining = std::thread::spawn(move || {
            join();
            start.elapsed()
        });
        let without = self.witness.watch_until(|| joining.is_finished());
        let joined = joining.join().unwrap();
        self.active().line("going on with the world at tick ");
        while !{
            let view = self.active().line("view ");
            view.contains("n1 r") && view.contains("n2 r")
        } {}
        let stood = without.max(self.witness.watch_for(Duration::from_secs(1)));
        Takeover { joined, stood }
    }

    /// Restarts the server that was killed or replaced, as a standby.
    fn stand_by(&mut self) {
        let other = 1 - self.active;
        let mut standby = serve(self.served, &self.place, &self.addresses[other], &self.data(other));
        standby.line("standing by for ");
        self.servers[other] = Some(standby);
    }

    /// Ends the world. Nothing is lost or doubled, and the standby server does not begin the world again.
    fn end(mut self) {
        self.witness.leave();
        let ended =
            Process::start(dcd(&["end", "--data"]).arg(self.folder.path().join(self.active.to_string())))
                .end();
        assert_eq!(ended.code(), Some(0), "{ended:?}");
        let served = self.servers[self.active].take().unwrap().end();
        let summary = served.json();
        assert_eq!((&summary["lost"], &summary["doubled"]), (&0.into(), &0.into()), "{served:?}");
        assert_eq!(summary["bodies"], self.served.1 + 10, "with the player's: {served:?}");
        for node in self.nodes {
            assert_eq!(node.end().code(), Some(0));
        }
        let ended = self.player.end();
        assert!(ended.errors.contains("the world has ended"), "{ended:?}");
        if let Some(standby) = self.servers[1 - self.active].take() {
            let ended = standby.end();
            assert!(ended.errors.contains("the world has ended while this server stood by"), "{ended:?}");
            assert_eq!(ended.code(), Some(3), "RestartPreventExitStatus");
        }
    }
}

/// The times of a takeover.
#[derive(Debug)]
struct Takeover {
    /// The time until a new client was admitted.
    joined: Duration,
    /// The longest time for which the world stood still.
    stood: Duration,
}

impl Takeover {
    /// Prints the times, checks the second, and returns how long joins had to wait.
    fn check(&self, what: &str) -> Duration {
        println!(
            "{what}: joins work again after {:.2?}; the world stood still for {:.2?}",
            self.joined, self.stood
        );
        assert!(self.stood < PAUSE, "{what}: {self:?}");
        self.joined
    }
}

/// Checks that joins work again in time. Since the machine itself may delay a run, there are two more
/// attempts.
fn is_taken_over_in_time(case: impl Fn() -> Option<Duration>) {
    let _alone = alone();
    let mut late = Vec::new();
    while let Some(joined) = case() {
        if joined < TAKEOVER {
            return;
        }
        late.push(joined);
        assert!(late.len() < 3, "{late:?}");
    }
}

/// The password of the servers' user where etcd has users.
const PASSWORD: &str = "of dcd";

fn serve((world, _): World, place: &str, listen: &str, data: &Path) -> Process {
    let mut command =
        dcd(&["serve", "--json", "--nodes", "2", "--listen", listen, "--directory", place, "--data"]);
    Process::start(command.env("DCD_ETCD_PASSWORD", PASSWORD).arg(data).args(world))
}

#[test]
fn a_server_that_is_killed_under_load_is_taken_over_by_the_one_that_stands_by() {
    let _alone = alone();
    let Some(mut pair) = Pair::start(1) else { return };
    let used = token(&pair.data(0), "client");
    drop(ClientWorld::connect(&joining(&pair.both(), used.clone())).unwrap());
    let takeovers = [(); 3].map(|()| {
        pair.active().kill();
        let joined = pair.take_over().check("killed");
        pair.stand_by();
        joined
    });
    let refused = ClientWorld::connect(&joining(&pair.both(), used)).map(drop).unwrap_err().to_string();
    assert!(refused.contains("used"), "a token is used for all servers: {refused}");
    pair.end();
    assert!(takeovers.iter().all(|joined| *joined < TAKEOVER), "{takeovers:?}");
}

#[test]
fn a_server_of_a_thousand_bodies_that_move_is_taken_over_as_soon() {
    is_taken_over_in_time(|| {
        let etcd = EtcdCluster::start(1)?;
        let mut pair = Pair::start_at(etcd.place("play"), etcd, CROWD);
        pair.active().kill();
        let joined = pair.take_over().check("killed while a thousand bodies move");
        pair.stand_by();
        pair.end();
        Some(joined)
    });
}

#[test]
fn a_server_is_taken_over_while_a_member_of_etcd_is_down() {
    is_taken_over_in_time(|| {
        let mut pair = Pair::start(3)?;
        // Whether or not this member leads: a server survives the loss of its etcd during an election.
        pair.etcd.kill(0);
        let stood = pair.witness.watch_for(Duration::from_secs(4));
        println!("a member of etcd is killed: the world stood still for {stood:.2?}");
        assert!(stood < PAUSE, "{stood:?}");
        pair.active().kill();
        let joined = pair.take_over().check("killed with one member of three down");
        pair.stand_by();
        pair.end();
        Some(joined)
    });
}

#[test]
fn a_server_is_taken_over_in_an_etcd_with_tls_and_users() {
    is_taken_over_in_time(|| {
        let options = ["--auth-token-ttl", "1"];
        let etcd = EtcdCluster::start_over_tls(&[Certified::Well; 3], &options)?;
        etcd.add_user("dcd", PASSWORD, "dcd/play/");
        etcd.enable_users();
        let mut pair = Pair::start_at(etcd.place("play") + "&user=dcd", etcd, PLAYGROUND);
        // The member that answers then did not issue the token.
        pair.etcd.kill(0);
        let stood = pair.witness.watch_for(Duration::from_secs(4));
        assert!(stood < PAUSE, "{stood:?}");
        pair.active().kill();
        let joined = pair.take_over().check("killed over TLS");
        pair.stand_by();
        pair.end();
        Some(joined)
    });
}

#[test]
fn a_server_without_a_users_password_says_what_is_missing() {
    let Some(etcd) = EtcdCluster::start_over_tls(&[Certified::Well], &[]) else { return };
    etcd.add_user("dcd", "another", "dcd/play/");
    etcd.enable_users();
    let folder = tempfile::tempdir().unwrap();
    let place = etcd.place("play");
    for (place, remedy) in [
        (place.clone(), "user=NAME&password-file=FILE"),
        (place + "&user=dcd", "user dcd with the password of the environment's DCD_ETCD_PASSWORD"),
    ] {
        let ended = serve(PLAYGROUND, &place, "127.0.0.1:0", folder.path()).end();
        assert!(ended.errors.contains(remedy), "{ended:?}");
        assert!(!ended.errors.contains(PASSWORD), "{ended:?}");
        assert!(!ended.status.success(), "{ended:?}");
    }
}

/// The active server stops, is taken over, and learns of that when it resumes.
fn stop_and_resume_the_active_server(stop: Duration) -> Option<Duration> {
    let mut pair = Pair::start(1)?;
    let former = pair.active;
    pair.active().signal("-STOP");
    let stopped = Instant::now();
    let joined = pair.take_over().check("stopped");
    pair.witness.watch_for(stop.saturating_sub(stopped.elapsed()));
    let former = pair.servers[former].take().unwrap();
    former.signal("-CONT");
    let ended = former.end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    assert!(ended.errors.contains("another server has taken over the world in etcd://"), "{ended:?}");
    let stood = pair.witness.watch_for(Duration::from_secs(2));
    assert!(stood < PAUSE, "{stood:?}");
    pair.end();
    Some(joined)
}

#[test]
fn a_server_that_was_stopped_for_five_seconds_is_fenced_out() {
    is_taken_over_in_time(|| stop_and_resume_the_active_server(Duration::from_secs(5)));
}

#[test]
#[ignore = "takes half a minute"]
fn a_server_that_was_stopped_for_thirty_seconds_is_fenced_out() {
    is_taken_over_in_time(|| stop_and_resume_the_active_server(Duration::from_secs(30)));
}

#[test]
fn a_server_that_is_told_to_stop_hands_over_to_the_one_that_stands_by() {
    is_taken_over_in_time(|| {
        let mut pair = Pair::start(1)?;
        pair.active().interrupt();
        let joined = pair.take_over().check("told to stop");
        let kept = pair.servers[1 - pair.active].take().unwrap().end();
        assert_eq!((kept.code(), &kept.json()["kept"]), (Some(0), &true.into()), "{kept:?}");
        pair.end();
        Some(joined)
    });
}

#[test]
fn a_server_of_another_world_does_not_stand_by() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let folder = tempfile::tempdir().unwrap();
    let (place, data) = (etcd.place("play"), folder.path().join("0"));
    let mut active = serve(PLAYGROUND, &place, "127.0.0.1:0", &data);
    let address = active.line("listening ");
    let _nodes = [(); 2].map(|()| {
        let token = token(&data, "node");
        Process::start(&mut dcd(&["node", "--threads", "1", "--server", &address, "--token", &token]))
    });
    active.line("view ");
    let other = ["serve", "tower", "--listen", "127.0.0.1:0", "--directory", &place, "--data"];
    let refused = Process::start(dcd(&other).arg(folder.path().join("1"))).end();
    assert_eq!(refused.code(), Some(2), "{refused:?}");
    for part in ["another world that has not ended", "it differs in bodies", "--directory"] {
        assert!(refused.errors.contains(part), "{refused:?}");
    }
    for wrong in ["data folder", "--fresh"] {
        assert!(!refused.errors.contains(wrong), "{refused:?}");
    }
    assert!(active.is_running());
}

#[test]
fn a_world_that_has_not_begun_is_handed_over_too() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let folder = tempfile::tempdir().unwrap();
    let place = etcd.place("play");
    let mut first = serve(PLAYGROUND, &place, "127.0.0.1:0", &folder.path().join("0"));
    first.line("listening ");
    let mut second = serve(PLAYGROUND, &place, "127.0.0.1:0", &folder.path().join("1"));
    second.line("standing by for ");
    let asks = |verb: &[&str], data: &str| {
        Process::start(dcd(verb).arg("--data").arg(folder.path().join(data))).end()
    };
    for verb in [&["end"][..], &["drain", "n1"], &["save", "saved.dcd"], &["backup", "elsewhere"]] {
        let ended = asks(verb, "1");
        assert_eq!(ended.code(), Some(2), "{ended:?}");
        assert!(ended.errors.contains("stands by, and another one has the world"), "{ended:?}");
    }
    let beside = serve(PLAYGROUND, &place, "127.0.0.1:0", &folder.path().join("1")).end();
    assert_eq!(beside.code(), Some(1), "{beside:?}");
    assert!(beside.errors.contains("another server"), "{beside:?}");
    first.interrupt();
    assert_eq!(first.end().code(), Some(0));
    second.line("listening ");
    let drained = asks(&["drain", "n1"], "1");
    assert!(drained.errors.contains("n1"), "it stands by no longer: {drained:?}");
    let mut third = serve(PLAYGROUND, &place, "127.0.0.1:0", &folder.path().join("2"));
    third.line("standing by for ");
    for stops in [third, second] {
        stops.interrupt();
        let ended = stops.end();
        assert_eq!(ended.code(), Some(0), "{ended:?}");
    }
}

#[test]
fn the_end_of_a_world_that_its_server_did_not_live_to_end_is_not_claimed() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("0");
    let mut server = serve(PLAYGROUND, &etcd.place("play"), "127.0.0.1:0", &data);
    server.line("listening ");
    server.signal("-STOP");
    let end = || Process::start(dcd(&["end", "--data"]).arg(&data));
    let asked = end();
    let begun = Instant::now();
    while !data.join("end-request").exists() {
        assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", asked.end());
        std::thread::sleep(Duration::from_millis(5));
    }
    server.kill();
    let ended = asked.end();
    assert_eq!(ended.code(), Some(1), "{ended:?}");
    assert!(ended.errors.contains("has stopped before it ended its world, which is in etcd"), "{ended:?}");
    let nobody = end().end();
    assert_eq!(nobody.code(), Some(2), "{nobody:?}");
    assert!(nobody.errors.contains("start its server again and end it then"), "{nobody:?}");
    let mut server = serve(PLAYGROUND, &etcd.place("play"), "127.0.0.1:0", &data);
    server.line("listening ");
    let [one, other] = [end(), end()].map(Process::end);
    for ended in [one, other] {
        assert_eq!(ended.code(), Some(0), "{ended:?}");
        assert!(ended.lines[0].contains("its server has stopped"), "{ended:?}");
    }
    server.end();
    // A server of the folder itself, as where the world was restored from a backup.
    let mut within =
        Process::start(dcd(&["serve", "--listen", "127.0.0.1:0", "--data"]).arg(&data).arg(playground()));
    within.line("listening ");
    let ended = end().end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    assert!(ended.lines[0].contains("its server has stopped"), "{ended:?}");
    within.end();
}
