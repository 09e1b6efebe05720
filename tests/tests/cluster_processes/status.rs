//! Tests `dcd status`: what it shows of a served world, as JSON and as a table.

use std::collections::BTreeSet;

use crate::metrics;
use crate::process::{LIMIT, Process, Server, dcd};

#[test]
fn the_status_of_a_world_names_each_node_and_each_region_once() {
    let scene = crate::process::playground();
    let mut server = Server::start(&[scene.to_str().unwrap(), "--nodes", "2", "--regions", "4"]);
    // Before a node joins, nobody computes anything.
    let token = server.token("client");
    let args = ["status", "--json", "--server", &server.address, "--token", &token];
    let empty = Process::start(&mut dcd(&args)).end();
    assert_eq!(empty.code(), Some(0), "{empty:?}");
    let empty = empty.json();
    assert_eq!(
        (&empty["nodes"], &empty["regions"], &empty["tick"]),
        (&[(); 0][..].into(), &[(); 0][..].into(), &0.into())
    );
    let mut nodes = [(); 2].map(|()| server.node_with(&["--metrics", "127.0.0.1:0"]).1);
    let scraped = nodes.each_mut().map(metrics::address);
    server.view();
    let mut status = dcd(&["status", "--json", "--server", &server.address, "--data"]);
    let ended = Process::start(status.arg(server.data())).end();
    assert_eq!(ended.code(), Some(0), "{ended:?}");
    let told = ended.json();
    let texts = |list: &str, key: &str| -> Vec<String> {
        let list = told[list].as_array().unwrap_or_else(|| panic!("{told}")).iter();
        list.map(|item| item[key].as_str().unwrap_or_else(|| panic!("{told}")).to_owned()).collect()
    };
    assert_eq!(texts("nodes", "node"), ["n1", "n2"]);
    assert_eq!(texts("nodes", "state"), ["leads", "computes"]);
    assert_eq!(texts("groups", "leader"), ["n1"]);
    let regions = texts("regions", "region");
    assert_eq!(regions.len(), 4);
    assert_eq!(regions.iter().collect::<BTreeSet<_>>().len(), 4, "each once: {told}");
    assert_eq!(texts("regions", "owner").into_iter().collect::<BTreeSet<_>>().len(), 2, "{told}");
    let of_nodes =
        told["nodes"].as_array().unwrap().iter().flat_map(|node| node["regions"].as_array().unwrap());
    let of_nodes: BTreeSet<_> = of_nodes.map(|region| region.as_str().unwrap().to_owned()).collect();
    assert_eq!(of_nodes, regions.into_iter().collect());
    let sum = |list: &str| {
        told[list].as_array().unwrap().iter().map(|item| item["bodies"].as_u64().unwrap()).sum::<u64>()
    };
    assert_eq!((sum("regions"), sum("nodes"), told["bodies"].as_u64()), (155, 155, Some(155)));
    assert!(told["ticks_per_s"].as_f64().unwrap() > 0.0, "the world goes on: {told}");
    // The owners' bodies are as the nodes count them, once the server's record has heard of them.
    metrics::wait("bodies by owner are those of the nodes", || {
        let mut status = dcd(&["status", "--json", "--server", &server.address, "--data"]);
        let told = Process::start(status.arg(server.data())).end().json();
        let own = scraped.each_ref().map(|node| metrics::scrape(node)["dcd_bodies"]);
        let said = [0, 1].map(|i: usize| told["nodes"][i]["bodies"].as_f64().unwrap());
        (own == said).then_some(())
    });
    // `dcd status` watches, and does not count as a client.
    assert_eq!((&told["clients"], &told["groups"][0]["clients"]), (&0.into(), &0.into()));
    let mut status = dcd(&["status", "--watch", "--server", &server.address, "--data"]);
    let mut watching = Process::start(status.arg(server.data()));
    let first = watching.line("tick ");
    assert!(first.contains("155 bodies, 4 regions, 2 nodes, 0 clients"), "{first}");
    assert!(watching.line("g1 (main): ").contains("n1 leads"));
    assert!(watching.line("n2 ").contains("computes"));
    watching.line("tick ");
    watching.interrupt();
    assert_eq!(watching.end().code(), Some(130));
    server.stop();
}

#[test]
fn a_status_needs_a_token_that_was_not_used() {
    let mut server = Server::start(&["pile"]);
    let token = server.token("client");
    let args = ["status", "--server", &server.address, "--token", &token];
    assert_eq!(Process::start(&mut dcd(&args)).end().code(), Some(0));
    let again = Process::start(&mut dcd(&args)).end();
    assert_eq!(again.code(), Some(2), "{again:?}");
    let none = Process::start(&mut dcd(&args[..3])).end();
    assert_eq!(none.code(), Some(2), "{none:?}");
    assert!(none.errors.contains("--token"), "{none:?}");
    let other = tempfile::tempdir().unwrap();
    let made = Process::start(dcd(&["token", "--role", "client", "--new", "--data"]).arg(other.path())).end();
    assert_eq!(made.code(), Some(0), "{made:?}");
    let foreign = ["status", "--server", &server.address, "--token", &made.lines[0]];
    let foreign = Process::start(&mut dcd(&foreign)).end();
    assert!(foreign.code() == Some(2) && foreign.errors.contains("does not prove to be"), "{foreign:?}");
    let nowhere = Process::start(&mut dcd(&["status", "--data", "/nowhere"])).end();
    assert!(nowhere.code() == Some(2) && nowhere.errors.contains("no server has used"), "{nowhere:?}");
    server.end_world();
    let none = Process::start(dcd(&["status", "--data"]).arg(server.data())).end();
    assert!(none.code() == Some(2) && none.errors.contains("no server runs"), "{none:?}");
}

#[test]
fn a_status_that_is_watched_goes_on_with_a_server_that_is_started_again() {
    let mut server = Server::playground("1");
    let (_, _node) = server.node();
    server.view();
    let mut watch = dcd(&["status", "--watch", "--json", "--server", &server.address, "--data"]);
    let mut watch = Process::start(watch.arg(server.data()));
    watch.line("{");
    server.process.interrupt();
    assert_eq!(server.process.end_within(LIMIT).code(), Some(0));
    let resumed = server.restart();
    let tick = |line: String| -> u64 {
        let told: serde_json::Value = serde_json::from_str(&format!("{{{line}")).unwrap();
        told["tick"].as_u64().unwrap()
    };
    while tick(watch.line("{")) <= resumed {}
    watch.interrupt();
    let ended = watch.end();
    assert_eq!(ended.code(), Some(130), "{ended:?}");
    assert_eq!(ended.errors.matches("dialling it again until Ctrl-C").count(), 1, "{ended:?}");
    server.stop();
}

#[test]
fn a_status_that_is_watched_ends_with_who_reads_it() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;
    let server = Server::start(&["tower"]);
    let mut watch = dcd(&["status", "--watch", "--json", "--server", &server.address, "--data"]);
    let mut watch = watch.arg(server.data()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(watch.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().starts_with('{'));
    drop(lines);
    metrics::wait("it ends", || watch.try_wait().unwrap().map(|status| assert!(status.success())));
}
