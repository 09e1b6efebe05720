//! Tests what servers and nodes report over HTTP: metrics in Prometheus' format, and their health.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::board;
use crate::process::{LIMIT, Process, Server, dcd};

/// Returns the address at which a process answers, from the line that it prints.
pub(crate) fn address(process: &mut Process) -> String {
    process.line("metrics http://").strip_suffix("/metrics").expect("the path of metrics").to_owned()
}

/// Returns the status and the content of an answer.
fn get(address: &str, path: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, content) = answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("{answer}"));
    let status =
        head.strip_prefix("HTTP/1.1 ").and_then(|rest| rest.get(..3)).unwrap_or_else(|| panic!("{head}"));
    assert!(head.contains(&format!("\r\nContent-Length: {}", content.len())), "{head}");
    (status.parse().unwrap(), content.to_owned())
}

/// Values by name and labels, in their text form: `dcd_messages_total{direction="in",subject="ticks"}`.
pub(crate) type Values = BTreeMap<String, f64>;

pub(crate) fn scrape(address: &str) -> Values {
    let (status, text) = get(address, "/metrics");
    assert_eq!(status, 200);
    parse(&text).unwrap_or_else(|error| panic!("{error} in\n{text}"))
}

/// Reads Prometheus' text format as strictly as Prometheus' own linter.
fn parse(text: &str) -> Result<Values, String> {
    let text = text.strip_suffix('\n').ok_or("the last line does not end")?;
    let (mut values, mut families) = (Values::new(), BTreeSet::new());
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let help = line.strip_prefix("# HELP ").and_then(|rest| rest.split_once(' '));
        let (family, help) = help.ok_or_else(|| format!("no HELP in `{line}`"))?;
        let kind = lines
            .next()
            .and_then(|line| line.strip_prefix("# TYPE ")?.strip_prefix(family)?.strip_prefix(' '));
        let kind = kind.ok_or_else(|| format!("no TYPE of {family}"))?;
        let is_name = family.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
        if !is_name || !help.ends_with('.') || !families.insert(family) {
            return Err(format!("{family}: a bad name, a bad help, or there twice"));
        }
        if (kind == "counter") != family.ends_with("_total")
            || !["counter", "gauge", "histogram"].contains(&kind)
        {
            return Err(format!("{family} is a {kind}"));
        }
        let mut samples = Vec::new();
        while let Some(line) = lines.next_if(|line| !line.starts_with('#')) {
            let (name, value) = line.rsplit_once(' ').ok_or_else(|| format!("no value in `{line}`"))?;
            let value: f64 = match value {
                "+Inf" => f64::INFINITY,
                value => value.parse().map_err(|_| format!("no number in `{line}`"))?,
            };
            let bare = name.split('{').next().unwrap_or(name);
            let suffix = bare.strip_prefix(family).ok_or_else(|| format!("`{line}` is not of {family}"))?;
            let suffixes: &[&str] = if kind == "histogram" { &["_bucket", "_sum", "_count"] } else { &[""] };
            if !suffixes.contains(&suffix) || value.is_nan() || (kind == "counter" && value < 0.0) {
                return Err(format!("`{line}` is no sample of a {kind}"));
            }
            if values.insert(name.to_owned(), value).is_some() {
                return Err(format!("{name} is there twice"));
            }
            samples.push((name, value));
        }
        if samples.is_empty() {
            return Err(format!("{family} has no sample"));
        }
        if kind == "histogram" {
            check_histogram(family, &samples)?;
        }
    }
    Ok(values)
}

fn check_histogram(family: &str, samples: &[(&str, f64)]) -> Result<(), String> {
    let Some(([buckets @ .., (_, infinite)], [(sum, _), (count, total)])) = samples.split_last_chunk() else {
        return Err(format!("{family} has too few samples"));
    };
    let names_fit = *sum == format!("{family}_sum") && *count == format!("{family}_count");
    let bound = |name: &str| {
        let bound = name.strip_prefix(family)?.strip_prefix("_bucket{le=\"")?.strip_suffix("\"}")?;
        bound.parse::<f64>().ok()
    };
    let bounds: Option<Vec<_>> = buckets.iter().map(|(name, _)| bound(name)).collect();
    let rises = bounds.is_some_and(|bounds| bounds.is_sorted_by(|a, b| a < b))
        && samples[..samples.len() - 2].is_sorted_by(|a, b| a.1 <= b.1);
    if names_fit && rises && infinite == total { Ok(()) } else { Err(format!("{family} is no histogram")) }
}

fn sum(values: &[Values], name: &str) -> f64 {
    values.iter().map(|values| values[name]).sum()
}

/// Waits until a condition holds, which must be soon.
pub(crate) fn wait<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + LIMIT;
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < deadline, "not within {LIMIT:?}: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_server_and_its_nodes_tell_prometheus_of_the_world_that_they_compute() {
    let scene = crate::process::playground();
    let mut server = Server::start(&[scene.to_str().unwrap(), "--nodes", "2", "--metrics", "127.0.0.1:0"]);
    let of_server = address(&mut server.process);
    // The port is open before the loop runs.
    wait("the server is ready", || (get(&of_server, "/readyz").0 == 200).then_some(()));
    assert_eq!(get(&of_server, "/healthz"), (200, "ok\n".to_owned()));
    let (_, mut first) = server.node_with(&["--metrics", "127.0.0.1:0"]);
    let of_first = address(&mut first);
    assert_eq!(get(&of_first, "/readyz"), (503, "the node is in no group yet\n".to_owned()));
    assert_eq!(get(&of_first, "/healthz").0, 200);
    assert_eq!(scrape(&of_first)["dcd_ticks_total"], 0.0);
    let (_, mut second) = server.node_with(&["--metrics", "127.0.0.1:0"]);
    let nodes = [of_first, address(&mut second)];
    for node in &nodes {
        wait("the node is ready", || (get(node, "/readyz").0 == 200).then_some(()));
    }
    // While a body is transferred, the two nodes may report different ticks.
    let world = wait("bodies add up", || {
        let (world, nodes) = (scrape(&of_server), nodes.each_ref().map(|node| scrape(node)));
        (sum(&nodes, "dcd_bodies") == 155.0 && world["dcd_world_bodies"] == 155.0).then_some((world, nodes))
    });
    let (world, before) = world;
    let expected = [("members", 2.0), ("regions", 2.0), ("nodes", 2.0), ("groups", 1.0), ("clients", 0.0)];
    for (name, value) in expected {
        assert_eq!(world[&format!("dcd_world_{name}")], value, "{name}");
    }
    assert_eq!((sum(&before, "dcd_regions"), sum(&before, "dcd_leads")), (2.0, 1.0));
    let label = |name: &str, direction: &str, subject: &str| {
        format!("dcd_{name}_total{{direction=\"{direction}\",subject=\"{subject}\"}}")
    };
    let rising = [
        "dcd_ticks_total".to_owned(),
        "dcd_exchanges_total".to_owned(),
        "dcd_tick_seconds_count".to_owned(),
        "dcd_tick_compute_seconds_sum".to_owned(),
        "dcd_round_seconds_count".to_owned(),
        "dcd_round_wait_seconds_sum".to_owned(),
        "dcd_udp_bytes_total{direction=\"in\"}".to_owned(),
        label("messages", "in", "borders"),
        label("message_bytes", "out", "borders"),
        label("messages", "in", "ticks"),
        label("message_bytes", "out", "ticks"),
    ];
    let after = wait("counters rise", || {
        let after = nodes.each_ref().map(|node| scrape(node));
        let risen = |name| before.iter().zip(&after).all(|(before, after)| after[name] > before[name]);
        rising.iter().all(risen).then_some(after)
    });
    for (before, after) in before.iter().zip(&after) {
        let is_counted =
            |name: &str| name.contains("_total") || name.contains("_bucket{") || name.ends_with("_count");
        for (name, value) in before.iter().filter(|(name, _)| is_counted(name)) {
            assert!(after[name] >= *value, "{name} fell from {value} to {}", after[name]);
        }
        assert_eq!(before.keys().collect::<Vec<_>>(), after.keys().collect::<Vec<_>>(), "series come and go");
        // A tick that spans the beginning of a view is not timed.
        assert!(after["dcd_tick_seconds_count"] <= after["dcd_ticks_total"]);
        assert!(after["dcd_tick_seconds_sum"] > after["dcd_tick_compute_seconds_sum"] / 2.0);
        assert_eq!(after["dcd_tick_compute_seconds_count"], after["dcd_ticks_total"]);
    }
    // The server's loop reads the counters of its links only now and then.
    let world = wait("joins are counted", || {
        Some(scrape(&of_server)).filter(|world| world["dcd_joins_total"] == 2.0)
    });
    board::check(after.iter().chain([&world]).flat_map(Values::keys));
    assert!(world["dcd_directory_commit_seconds_count"] > 0.0 && world["dcd_directory_bytes_total"] > 0.0);
    assert_eq!(world["dcd_world_views_total"], 1.0);
    let refused = "dcd_rejections_total{cause=\"join\"}";
    assert_eq!(world[refused], 0.0);
    // A used token is refused.
    let token = server.token("node");
    let args = ["node", "--server", &server.address, "--token", &token];
    let mut third = Process::start(&mut dcd(&args));
    third.line("joined as ");
    assert_eq!(Process::start(&mut dcd(&args)).end().code(), Some(2));
    wait("it is counted", || (scrape(&of_server)[refused] == 1.0).then_some(()));
    server.stop();
}

#[test]
fn an_address_for_metrics_that_is_taken_is_named_and_stops_the_process() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let at = taken.local_addr().unwrap().to_string();
    let folder = tempfile::tempdir().unwrap();
    let (data, record) = (folder.path().join("data"), folder.path().join("server.dcdr"));
    let args = ["serve", "pile", "--listen", "127.0.0.1:0", "--fresh", "--metrics", &at, "--data"];
    let ended = Process::start(dcd(&args).arg(&data).arg("--record").arg(&record)).end();
    assert_eq!(ended.code(), Some(2), "{ended:?}");
    assert!(ended.errors.contains(&at) && ended.errors.contains("free address"), "{ended:?}");
    assert!(!data.exists() && !record.exists(), "nothing was done");
}

#[test]
fn the_parser_of_these_tests_is_strict() {
    let good = "# HELP a_total A.\n# TYPE a_total counter\na_total{b=\"c\"} 1\n";
    assert_eq!(parse(good).unwrap()["a_total{b=\"c\"}"], 1.0);
    let bad = [
        good.trim_end().to_owned(),
        good.replace("# HELP a_total A.\n", ""),
        good.replace("A.", "A"),
        good.replace("counter", "gauge"),
        good.replace(" 1\n", " one\n"),
        good.replace("a_total{", "b_total{"),
        format!("{good}a_total{{b=\"c\"}} 2\n"),
        format!("{good}{good}"),
        "# HELP a A.\n# TYPE a gauge\n".to_owned(),
        "# HELP h H.\n# TYPE h histogram\nh_bucket{le=\"1\"} 2\nh_bucket{le=\"+Inf\"} 1\nh_sum 1\nh_count 1\n".to_owned(),
        "# HELP h H.\n# TYPE h histogram\nh_bucket{le=\"1\"} 1\nh_bucket{le=\"+Inf\"} 2\nh_sum 1\nh_count 1\n".to_owned(),
    ];
    for text in bad {
        assert!(parse(&text).is_err(), "{text}");
    }
}
