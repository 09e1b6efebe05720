//! Reads the stream of a viewer: what it holds, who may read it, and that no page holds up others.

use std::io::Read;

use dcd_tests::socket;
use serde_json::json;

use crate::process::{CHOOSE, CONTACTS, PAST, PAUSE, Page, Process, SEE, SPEED, STEP, parts};

fn pile() -> (Process, String) {
    let mut process =
        Process::start(&["run", "pile", "--set", "n=200", "--regions", "4", "--threads", "1", "--view"]);
    let url = process.line("view ");
    (process, url)
}

#[test]
fn every_body_is_shown_where_it_is_by_its_owner() {
    let (process, url) = pile();
    let mut page = Page::open(&url).unwrap();
    page.until("it moves", |seen| seen.tick >= 20.0);
    let seen = &page.seen;
    assert!(seen.controls && seen.fixed >= 1, "{} fixed", seen.fixed);
    assert_eq!((seen.movable, seen.rows.len(), seen.regions), (200, 200, 4));
    for row in &seen.rows {
        let norm: f32 = row.turn.iter().map(|v| v * v).sum();
        assert!(row.present && (norm - 1.0).abs() < 1e-3 && row.owner < 4, "{row:?}");
        assert!(row.at.iter().all(|v| v.abs() < 100.0), "{row:?}");
    }
    let owners: std::collections::BTreeSet<u8> = seen.rows.iter().map(|row| row.owner).collect();
    assert!(owners.len() >= 2, "{owners:?}");
    assert!(seen.samples >= 19, "{} samples of {} ticks", seen.samples, seen.tick);
    assert_eq!(process.interrupt(), Some(130));
}

#[test]
fn a_page_pauses_the_world_steps_it_and_goes_back() {
    let (_process, url) = pile();
    let mut page = Page::open(&url).unwrap();
    page.until("there is a past", |seen| seen.newest >= 10.0);
    page.ask(PAUSE, 1);
    page.until("it pauses", |seen| seen.paused);
    page.skip_late();
    let paused = page.seen.newest;
    page.ask(STEP, 3);
    page.until("it stepped", |seen| seen.newest >= paused + 3.0);
    page.look(SEE, 0);
    assert_eq!(page.seen.newest, paused + 3.0);
    let now = page.seen.rows.clone();
    let oldest = page.seen.oldest;
    page.look(PAST, oldest as u64);
    assert_eq!(page.seen.tick, oldest);
    assert_ne!(page.seen.rows, now);
    page.look(PAST, u64::MAX);
    assert_eq!((page.seen.tick, &page.seen.rows), (paused + 3.0, &now));
    page.look(PAST, oldest as u64);
    page.look(SEE, 0);
    assert_eq!((page.seen.tick, &page.seen.rows), (paused + 3.0, &now), "it comes back while nothing moves");
    page.ask(PAUSE, 0);
    page.until("it goes on", |seen| seen.newest > paused + 10.0);
}

#[test]
fn a_body_that_is_chosen_is_told_of_and_contacts_are_shown_when_asked_for() {
    let (_process, url) = pile();
    let mut page = Page::open(&url).unwrap();
    page.ask(CHOOSE, 7);
    page.until("it is told of", |seen| seen.details.is_some());
    let details = page.seen.details.take().unwrap();
    assert_eq!((&details["id"], &details["bits"]), (&json!("b7"), &json!("7")));
    assert!(
        details["mass_kg"].as_f64().unwrap() > 0.0 && details["holders"].as_u64().unwrap() >= 1,
        "{details}"
    );
    assert!(details["owners"].is_array() && details["epoch"].is_u64(), "{details}");
    page.until("boxes lie", |seen| seen.tick >= 30.0);
    assert_eq!(page.seen.contacts, 0);
    page.ask(CONTACTS, 1);
    page.until("contacts are shown", |seen| seen.contacts > 50);
    page.ask(PAUSE, 1);
    page.until("it pauses", |seen| seen.paused);
    page.skip_late();
    page.seen.details = None;
    page.look(SEE, 0);
    assert!(page.seen.details.is_none(), "there is no news of it");
    page.ask(CHOOSE, 7);
    page.until("it is told of again", |seen| seen.details.is_some());
}

#[test]
fn only_the_page_of_the_viewer_may_read_its_stream() {
    let (_process, url) = pile();
    let (address, key) = parts(&url);
    let refused = |path: &str, host: &str, origin: &str| {
        socket::open(&address, path, host, Some(origin))
            .expect_err("it is refused")
            .lines()
            .next()
            .unwrap()
            .to_owned()
    };
    let (own, stream) = (format!("http://{address}"), format!("/stream?key={key}"));
    let port = address.rsplit_once(':').unwrap().1;
    let rebound = format!("rebound.example:{port}");
    assert!(refused(&stream, &rebound, &format!("http://{rebound}")).contains("421"));
    assert!(refused(&stream, &address, "http://elsewhere.example").contains("403"));
    assert!(refused(&stream, &address, "null").contains("403"));
    assert!(refused("/stream?key=0", &address, &own).contains("403"));
    assert!(refused("/stream", &address, &own).contains("403"));
    assert!(refused("/../Cargo.toml", &address, &own).contains("404"));
    assert!(socket::open(&address, &stream, &address, Some(&own)).is_ok());
}

#[test]
fn the_page_is_small_and_loads_nothing_from_elsewhere() {
    let (_process, url) = pile();
    let (address, _) = parts(&url);
    let mut files = vec!["/".to_owned()];
    let mut size = 0;
    let mut at = 0;
    while let Some(file) = files.get(at) {
        let head = format!("GET {file} HTTP/1.1\r\nHost: {address}\r\n\r\n");
        let (mut stream, answer, mut content) = socket::request(&address, &head).unwrap();
        assert!(
            answer.starts_with("HTTP/1.1 200 ") && answer.contains("default-src 'self'"),
            "{file}: {answer}"
        );
        stream.read_to_end(&mut content).unwrap();
        size += content.len();
        let content = String::from_utf8(content).unwrap();
        let is_file = |word: &&str| {
            word.starts_with('/') && word.contains('.') && !word.contains(|c: char| c.is_whitespace())
        };
        for word in content.split('"').filter(is_file) {
            if !files.iter().any(|file| file == word) {
                files.push(word.to_owned());
            }
        }
        at += 1;
    }
    assert!(files.len() >= 6 && size <= 100_000, "{files:?}: {size} bytes");
}

#[test]
fn viewers_are_few_and_one_that_does_not_read_holds_up_nobody() {
    let (_process, url) = pile();
    let mut pages: Vec<Page> = (0..8).map(|_| Page::open(&url).unwrap()).collect();
    assert!(Page::open(&url).err().is_some_and(|answer| answer.contains("503")));
    // This page asks, and reads nothing.
    let mut idle = pages.pop().unwrap();
    for _ in 0..1000 {
        idle.ask(SEE, 0);
    }
    // This page sends an invalid message, and is disconnected.
    let mut odd = pages.pop().unwrap();
    odd.ask(99, 0);
    while odd.socket.read().is_ok() {}
    let mut page = pages.pop().unwrap();
    page.until("the world goes on", |seen| seen.tick >= 60.0);
    drop((odd, pages));
    let mut again = Page::open(&url).unwrap();
    again.until("a later page sees it too", |seen| seen.movable == 200 && seen.frames > 0);
}

#[test]
fn a_served_world_is_shown_as_a_client_is_told_of_it() {
    let data = tempfile::tempdir().unwrap();
    let data = data.path().to_str().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../dcd/scenes/playground.toml");
    let mut server = Process::start(&["serve", scene, "--listen", "127.0.0.1:0", "--data", data, "--view"]);
    let address = server.line("listening ");
    let url = server.line("view ");
    let token = |role: &str| Process::start(&["token", "--data", data, "--role", role]).line("dcd1-");
    let dcd1 = |rest: String| format!("dcd1-{rest}");
    let node_token = dcd1(token("node"));
    let mut node = Process::start(&["node", "--server", &address, "--token", &node_token, "--view"]);
    let mut page = Page::open(&url).unwrap();
    page.until("the world goes", |seen| seen.tick >= 30.0 && seen.movable > 5);
    assert!(!page.seen.controls && page.seen.fixed >= 1);
    page.ask(PAUSE, 1);
    page.ask(STEP, 1);
    let now = page.seen.tick;
    page.until("it goes on", |seen| seen.tick >= now + 10.0);
    assert!(!page.seen.paused, "it is not said to be paused");
    let before = page.seen.movable;
    let client_token = dcd1(token("client"));
    let mut client = Process::start(&["client", "--server", &address, "--token", &client_token, "--view"]);
    page.until("the avatar is there", |seen| seen.movable > before);
    let mut own = Page::open(&client.line("view ")).unwrap();
    own.until("it sees the world too", |seen| seen.tick >= 30.0 && seen.movable > before);
    let mut computed = Page::open(&node.line("view ")).unwrap();
    computed.until("it shows what it computes", |seen| seen.tick >= 30.0 && seen.movable > before);
}

#[test]
fn a_node_is_shown_by_its_regions_its_ghosts_and_its_contacts() {
    let data = tempfile::tempdir().unwrap();
    let data = data.path().to_str().unwrap();
    let scene = ["serve", "wall", "--set", "width=40", "--set", "sleep=0", "--regions", "2", "--nodes", "2"];
    let mut server = Process::start(&[&scene[..], &["--listen", "127.0.0.1:0", "--data", data]].concat());
    let address = server.line("listening ");
    let mut nodes: Vec<_> = (0..2)
        .map(|_| {
            let token = Process::start(&["token", "--data", data, "--role", "node"]).line("dcd1-");
            let token = format!("dcd1-{token}");
            Process::start(&["node", "--server", &address, "--token", &token, "--view"])
        })
        .collect();
    let (mut own, bricks) = ([0; 2], 324);
    for (node, own) in nodes.iter_mut().zip(&mut own) {
        let mut page = Page::open(&node.line("view ")).unwrap();
        page.ask(CONTACTS, 1);
        page.until("bricks of both lie on one another", |seen| seen.contacts > 10 && seen.ghosts > 10);
        let seen = &page.seen;
        assert!(!seen.controls && seen.regions == 2 && seen.fixed >= 1);
        let rows = || seen.rows.iter().filter(|row| row.present);
        let owners: std::collections::BTreeSet<u8> = rows().map(|row| row.owner).collect();
        assert_eq!(owners.len(), 2, "its own bodies, and guests");
        *own = rows().count();
        assert!(*own < bricks && rows().all(|row| row.at.iter().all(|v| v.abs() < 100.0)), "{own}");
    }
    assert!(own[0] + own[1] > bricks, "what both hold is shown by both: {own:?}");
}

#[test]
fn a_viewer_takes_a_world_of_regions_and_an_address_that_is_free() {
    let mut bare = Process::start(&["run", "tower", "--regions", "0", "--view"]);
    assert!(bare.line("error: ").contains("--view takes a world of regions"));
    let (_process, url) = pile();
    let mut taken = Process::start(&["run", "tower", "--view", &parts(&url).0]);
    assert!(taken.line("error: ").contains("choose an address of this machine and a free port"));
}

/// Measures what a page that reads as fast as it can costs the world. The cost is printed, and bounded only
/// where nothing else runs (`cargo test -p dcd-tests --test view -- --ignored`).
#[test]
#[ignore = "measures"]
fn a_viewer_slows_no_step_by_more_than_two_percent() {
    let args = ["run", "pile", "--set", "n=20000", "--regions", "2", "--seconds", "2", "--json"];
    let step_ms = |line: &str| {
        let report: serde_json::Value = serde_json::from_str(&format!("{{\"scene\"{line}")).unwrap();
        report["step_ms"]["p50"].as_f64().unwrap()
    };
    let (mut without, mut with) = (Vec::new(), Vec::new());
    for _ in 0..5 {
        without.push(step_ms(&Process::start(&args).line("{\"scene\"")));
        let mut process = Process::start(&[&args[..], &["--view"]].concat());
        let mut page = Page::open(&process.line("view ")).unwrap();
        page.ask(SPEED, 0.0f64.to_bits());
        while page.try_look(SEE, 0) {}
        println!("{} pictures of {} ticks", page.seen.frames, page.seen.newest);
        with.push(step_ms(&process.line("{\"scene\"")));
    }
    let least = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
    let share = least(&with) / least(&without) - 1.0;
    println!("without {without:?} ms, with {with:?} ms: {:.1} %", 100.0 * share);
    assert!(share <= 0.02, "{share}");
}
