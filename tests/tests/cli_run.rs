//! Tests `dcd run` and `dcd scenes` as real processes: results, files, errors, exit codes, Ctrl-C.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

const BINARY: &str = env!("CARGO_BIN_EXE_dcd-under-test");

fn dcd(args: &[&str]) -> Output {
    Command::new(BINARY)
        .args(args)
        .env_remove("RUST_LOG")
        .output()
        .expect("the binary was built for this test")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("output is UTF-8")
}

/// Returns the JSON object of a run that must succeed: the only line of standard output.
fn json(args: &[&str]) -> Value {
    let output = dcd(&[args, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let stdout = text(&output.stdout);
    assert_eq!(stdout.lines().count(), 1, "{stdout}");
    serde_json::from_str(&stdout).unwrap()
}

/// Returns the error output of a run that must fail.
fn error(args: &[&str], code: i32) -> String {
    let output = dcd(args);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}");
    assert!(stderr.starts_with("error: "), "{args:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{args:?}: {}", text(&output.stdout));
    stderr
}

fn keys(object: &Value) -> BTreeSet<&str> {
    object.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn set(names: &str) -> BTreeSet<&str> {
    names.split_whitespace().collect()
}

#[test]
fn the_json_object_has_the_keys_of_the_contract() {
    let report = json(&["run", "tower", "--seconds", "2", "--cut", "x=0"]);
    assert_eq!(
        keys(&report),
        set("scene bodies regions threads coupling exchanges exchanges_mean disagreement_m_s imbalance ticks dt_s wall_s rtf step_ms contacts ghosts_mean transfers
             energy_j momentum_kgms max_penetration_m ground_force_ratio lost doubled quarantined state_hash chosen")
    );
    assert_eq!(keys(&report["step_ms"]), set("mean p50 p99 max"));
    assert_eq!(keys(&report["energy_j"]), set("start end"));
    assert_eq!(report["momentum_kgms"]["end"].as_array().unwrap().len(), 3);
    assert_eq!((report["scene"].as_str(), report["coupling"].as_str()), (Some("tower"), Some("auto")));
    for (key, value) in
        [("bodies", 10), ("regions", 2), ("ticks", 120), ("contacts", 10), ("exchanges", 4), ("lost", 0)]
    {
        assert_eq!(report[key], value, "{key}");
    }
    let ratio = report["ground_force_ratio"].as_f64().unwrap();
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    let hash = report["state_hash"].as_str().unwrap();
    assert!(hash.len() == 16 && u64::from_str_radix(hash, 16).is_ok(), "{hash}");
    let seconds = report["ticks"].as_f64().unwrap() * report["dt_s"].as_f64().unwrap();
    let rtf = report["rtf"].as_f64().unwrap() * report["wall_s"].as_f64().unwrap() / seconds;
    assert!((rtf - 1.0).abs() < 1e-6);
}

#[test]
fn what_is_not_computed_in_full_is_said() {
    let report = json(&["run", "town", "--set", "n=600", "--seconds", "4", "--fidelity", "auto"]);
    let said = &report["fidelity"];
    assert_eq!(keys(said), set("share_of_full_time error_stated_m_s audits overruns levels"));
    assert_eq!(keys(&said["error_stated_m_s"]), set("mean low95 high95"));
    assert!(said["levels"][2].as_u64().unwrap() > 10, "{said}");
    assert!(said["share_of_full_time"].as_f64().unwrap() < 0.9, "{said}");
    let everywhere = [
        "run",
        "town",
        "--set",
        "n=600",
        "--seconds",
        "1",
        "--fidelity",
        "budget=1000",
        "--viewpoint",
        "-5,0,0,1e4",
    ];
    assert_eq!(json(&everywhere)["fidelity"]["levels"], serde_json::json!([24, 0, 0]));
    assert!(error(&["run", "tower", "--fidelity", "sharp"], 2).contains("off, auto"));
    assert!(error(&["run", "tower", "--viewpoint", "1,2,3"], 2).contains("10,2,-5,50"));
    assert!(error(&["run", "tower", "--regions", "0", "--fidelity", "auto"], 2).contains("--fidelity"));
    let alone = ["run", "tower", "--regions", "2", "--viewpoint", "0,0,0,20"];
    assert!(error(&alone, 2).contains("add --fidelity auto"));
    let in_full = [&alone[..], &["--seconds", "0.1", "--fidelity", "off"]].concat();
    assert_eq!(json(&in_full)["fidelity"], Value::Null);
}

#[test]
fn a_bare_world_takes_no_option_that_it_would_ignore() {
    for given in [["--coupling", "owner"], ["--exchanges", "4"], ["--preset", "game"], ["--threads", "2"]] {
        let said = error(&[&["run", "tower", "--regions", "0"], &given[..]].concat(), 2);
        assert!(said.contains(&format!("{} takes a world of regions", given[0])), "{said}");
    }
}

#[test]
fn balance_keeps_the_regions_that_bodies_far_apart_need_and_says_where_it_has_nothing_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.toml");
    let town = |x: i32| {
        format!("[[body]]\nposition = [{x}, 1, 0]\n[[body.collider]]\nshape = \"sphere\"\nradius = 0.5\n")
    };
    std::fs::write(&path, town(-30_000) + &town(30_000)).unwrap();
    let far = ["run", path.to_str().unwrap(), "--seconds", "2"];
    assert_eq!(json(&far)["regions"], 2);
    assert_eq!(json(&[&far[..], &["--balance"]].concat())["regions"], 2);
    assert!(error(&["run", "pile", "--balance"], 2).contains("--balance 1-8"));
    let ranged = folder.path().join("ranged.toml");
    std::fs::write(&ranged, format!("[world]\nbalance = {{ most_regions = 4 }}\n{}", town(0))).unwrap();
    // The scene sets the range: one region that may become four can be balanced.
    json(&["run", ranged.to_str().unwrap(), "--seconds", "0.1", "--balance"]);
}

#[test]
fn a_scene_that_asks_for_what_cannot_be_is_named_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fast.toml");
    let ball = "velocity = [20, 0, 0]\n[[body.collider]]\nshape = \"sphere\"\nradius = 0.5\n";
    std::fs::write(&path, format!("[world]\nspeed_limit = 10\n[[body]]\n{ball}")).unwrap();
    let (path, data) = (path.to_str().unwrap(), folder.path().join("data"));
    let serve = ["serve", path, "--listen", "127.0.0.1:0", "--data", data.to_str().unwrap()];
    for args in [&["run", path][..], &serve] {
        let said = error(args, 2);
        assert!(said.contains("the scene `fast`") && said.contains("20 m/s"), "{said}");
    }
    assert!(!data.exists());
}

#[test]
fn a_run_that_cannot_begin_leaves_no_file_and_records_over_none() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (csv, film, nowhere) = (file("new.csv"), file("new.glb"), file("no/such/x.dcd"));
    error(&["run", "tower", "--out", &csv, "--gltf", &film, "--save", &nowhere], 2);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let recording = file("a.dcdr");
    let run = ["run", "tower", "--seconds", "0.1", "--record", &recording];
    json(&run);
    let recorded = std::fs::read(&recording).unwrap();
    assert!(error(&run, 2).contains("is there already"));
    assert_eq!(std::fs::read(&recording).unwrap(), recorded);
}

#[test]
fn a_run_overwrites_neither_its_scene_nor_one_result_by_another() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (scene, one, again) = (path("scene.toml"), path("one"), path("./one"));
    std::fs::write(&scene, "[library]\nscene = \"tower\"\n").unwrap();
    let text = std::fs::read(&scene).unwrap();
    let base = ["run", &scene, "--seconds", "0.1"];
    for [a, b] in [["--save", "--record"], ["--out", "--save"], ["--out", "--gltf"], ["--record", "--gltf"]] {
        let said = error(&[&base[..], &[a, &one, b, &again]].concat(), 2);
        assert!(said.contains(&format!("{a} and {b} both name")), "{said}");
        assert!(said.contains("a file of its own"), "{said}");
    }
    for option in ["--out", "--save", "--gltf"] {
        let said = error(&[&base[..], &[option, &scene]].concat(), 2);
        assert!(
            said.contains("is the file of the scene") && said.contains(&format!("give {option}")),
            "{said}"
        );
    }
    assert_eq!(
        (std::fs::read(&scene).unwrap(), std::fs::read_dir(folder.path()).unwrap().count()),
        (text, 1)
    );
    // A snapshot is replaced by the one that goes on from it, and by nothing else.
    let saved = path("saved.dcd");
    json(&[&base[..], &["--save", &saved]].concat());
    let goes_on = ["run", &saved, "--seconds", "0.1"];
    json(&[&goes_on[..], &["--save", &saved, "--out", &one]].concat());
    assert!(error(&[&goes_on[..], &["--out", &saved]].concat(), 2).contains("is the file of the scene"));
}

#[test]
fn a_recording_and_what_is_no_text_are_told_from_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (recording, other) = (path("a.dcdr"), path("other_name"));
    json(&["run", "tower", "--seconds", "0.1", "--record", &recording]);
    std::fs::copy(&recording, &other).unwrap();
    for name in [&recording, &other] {
        let said = error(&["run", name], 2);
        assert!(said.contains("is a recording") && said.contains(&format!("`dcd replay {name}`")), "{said}");
    }
    for name in ["junk.xml", "junk.urdf", "junk.toml"] {
        std::fs::write(path(name), [0xff, 0xfe, 0x00, 0x80]).unwrap();
        let said = error(&["run", &path(name)], 2);
        assert!(said.contains("it is no text") && said.contains("give a scene file"), "{said}");
        assert!(!said.contains("permissions"), "{said}");
    }
}

#[test]
fn one_region_gives_the_same_bits_as_the_bare_world() {
    for scene in [&["tower"][..], &["pile", "--set", "n=60"], &["gas", "--set", "n=60"]] {
        let run = |regions| {
            let mut report = json(&[&["run", "--seconds", "2", "--regions", regions], scene].concat());
            let object = report.as_object_mut().unwrap();
            for own in ["regions", "threads", "coupling", "exchanges", "wall_s", "rtf", "step_ms", "chosen"] {
                object.remove(own).unwrap();
            }
            report
        };
        assert_eq!(run("0"), run("1"), "{scene:?}");
    }
}

#[test]
fn a_world_that_nobody_cuts_is_one_region_on_all_threads_and_every_number_of_them_gives_the_same_bits() {
    for scene in ["pile", "dve", "wall", "chain", "ragdolls"] {
        let run = |args: &[&str]| json(&[&["run", scene, "--seconds", "1"], args].concat());
        let bare = run(&["--regions", "0"]);
        for threads in ["1", "2", "4"] {
            let report = run(&["--threads", threads]);
            let (regions, asked) =
                (report["chosen"]["regions"].as_u64(), report["chosen"]["threads"].as_u64());
            assert_eq!((regions, asked), (Some(1), threads.parse().ok()), "{scene}");
            let why = report["chosen"]["why"].as_str().unwrap();
            assert!(why.starts_with("one region is exact"), "{why}");
            assert_eq!(report["state_hash"], bare["state_hash"], "{scene} on {threads} threads");
        }
    }
    let cut = json(&["run", "tower", "--seconds", "0.1", "--regions", "2"]);
    assert_eq!(
        (cut["chosen"]["regions"].as_u64(), cut["chosen"]["why"].as_str()),
        (Some(2), Some("asked for"))
    );
    assert_eq!(cut["chosen"]["coupling"], "auto");
}

#[test]
fn threads_and_cuts_are_as_asked_and_the_same_cut_gives_the_same_bits() {
    let run = |args: &[&str]| json(&[&["run", "gas", "--set", "n=80", "--seconds", "1"], args].concat());
    let (halved, cut) =
        (run(&["--regions", "2", "--threads", "1"]), run(&["--cut", "x=0", "--threads", "2"]));
    assert_eq!((halved["threads"].as_u64(), cut["threads"].as_u64()), (Some(1), Some(2)));
    assert_eq!(halved["state_hash"], cut["state_hash"]);
    assert_eq!(cut["ground_force_ratio"], Value::Null);
    assert_eq!(run(&["--cut", "x=0", "--cut", "y=1"])["regions"], 4);
}

#[test]
fn a_file_chooses_the_coupling_and_options_win() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("coupled.toml");
    let world = "coupling = \"overlap\"\nexchanges = 3\ncuts = [{ axis = \"y\", at = 5.0 }]";
    std::fs::write(&path, format!("[world]\n{world}\n[library]\nscene = \"tower\"\n")).unwrap();
    let run = |args: &[&str]| {
        let report = json(&[&["run", path.to_str().unwrap(), "--seconds", "0.5"], args].concat());
        let coupling = report["coupling"].as_str().unwrap().to_owned();
        (coupling, report["exchanges"].as_u64().unwrap(), report["exchanges_mean"].as_f64().unwrap())
    };
    assert_eq!(run(&[]), ("overlap".into(), 3, 3.0));
    assert_eq!(run(&["--exchanges", "2"]), ("overlap".into(), 2, 2.0));
    assert_eq!(run(&["--coupling", "owner"]), ("owner".into(), 1, 1.0));
    let (coupling, most, mean) = run(&["--preset", "draft", "--tolerance", "0.001"]);
    assert_eq!((coupling.as_str(), most), ("auto", 2));
    assert!((1.0..=2.0).contains(&mean), "{mean}");
}

#[test]
fn steps_are_timed_from_the_31st() {
    let report = json(&["run", "tower", "--seconds", "0.5"]);
    assert_eq!((report["ticks"].as_u64(), &report["step_ms"]["p50"]), (Some(30), &Value::Null));
    let report = json(&["run", "tower", "--seconds", "0.6"]);
    assert!(report["step_ms"]["p50"].as_f64().unwrap() > 0.0);
}

#[test]
fn the_csv_holds_every_movable_body_in_id_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.csv");
    std::fs::write(&path, "a longer file that is there already\n".repeat(100)).unwrap();
    let path_text = path.to_str().unwrap();
    json(&["run", "gas", "--set", "n=40", "--regions", "2", "--seconds", "0.2", "--out", path_text]);
    let csv = std::fs::read_to_string(&path).unwrap();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("id,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz,region"));
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 40);
    assert!(rows.iter().all(|row| row.len() == 15));
    // The six walls, 40 to 45, cannot move.
    assert!(rows.iter().map(|row| row[0]).eq((0..40).map(f64::from)));
    let regions: BTreeSet<_> = rows.iter().map(|row| row[14] as u32).collect();
    assert_eq!(regions, BTreeSet::from([1, 2]));
    assert!(rows.iter().all(|row| (row[4..8].iter().map(|q| q * q).sum::<f64>() - 1.0).abs() < 1e-5));
}

#[test]
fn people_get_a_table() {
    let output = dcd(&["run", "tower", "--seconds", "1"]);
    let stdout = text(&output.stdout);
    assert!(stdout.starts_with("tower: 10 bodies, 1 region\n60 ticks (1.00 s)"), "{stdout}");
    assert!(stdout.contains("\nground force  ") && stdout.contains("\nlost          0\n"), "{stdout}");
    assert_eq!(text(&output.stderr), "", "no progress without a terminal");
}

#[test]
fn scene_files_run_like_scenes_of_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.toml");
    let file = "[world]\nname = \"two\"\n[library]\nscene = \"tower\"\nparams = { n = 2 }\n";
    std::fs::write(&path, file).unwrap();
    let report = json(&["run", path.to_str().unwrap(), "--seconds", "0.1"]);
    assert_eq!((report["scene"].as_str(), report["bodies"].as_u64()), (Some("two"), Some(2)));
}

#[test]
fn shipped_scene_files_go_by_their_bare_names() {
    let report = json(&["run", "dominoes", "--seconds", "0.1"]);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../dcd/scenes/dominoes.toml");
    assert_eq!(report["state_hash"], json(&["run", path, "--seconds", "0.1"])["state_hash"]);
    assert!(error(&["run", "domino"], 2).contains("no scene `domino`"));
    let told = dcd(&["scenes", "dominoes"]);
    assert!(text(&told.stdout).contains("scenes/dominoes.toml"), "{}", text(&told.stdout));
}

#[test]
fn balance_shares_a_convoy_out_among_its_regions() {
    let busiest = |balance: &[&str]| {
        let args = ["run", "convoy", "--set", "cars=16", "--set", "road=20000", "--seconds", "8"];
        let report = json(&[&args[..], balance].concat());
        assert_eq!((report["lost"].as_u64(), report["bodies"].as_u64()), (Some(0), Some(128)));
        (report["imbalance"]["mean"].as_f64().unwrap(), report["regions"].as_u64().unwrap())
    };
    let (fixed, regions) = busiest(&["--regions", "4"]);
    assert!(fixed > 3.5 && regions == 4, "all cars are in the first of the four regions: {fixed}");
    let (balanced, regions) = busiest(&["--regions", "4", "--balance"]);
    assert!(balanced < 2.0 && regions == 4, "{balanced}");
    assert_eq!(busiest(&["--balance", "3-5"]).1, 3, "no fewer than three, and no reason for more");
    assert!(error(&["run", "convoy", "--balance", "5-3"], 2).contains("as 1-8"));
    assert!(
        error(&["run", "convoy", "--balance", "--regions", "0"], 2)
            .contains("--balance takes a world of regions")
    );
}

/// `script` gives the process a terminal.
#[cfg(target_os = "linux")]
#[test]
fn whoever_looks_on_at_a_terminal_sees_the_regions_and_pipes_and_json_do_not() {
    let on_terminal = |args: &str| {
        let line = format!("stty cols 120; {BINARY} run pile --set n=400 --regions 3 --seconds 1 {args}");
        let output = Command::new("script")
            .args(["--quiet", "--return", "--command", &line, "/dev/null"])
            .env("TERM", "xterm")
            .stdin(std::process::Stdio::null())
            .output()
            .expect("`script` of util-linux is there");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
        text(&output.stdout)
    };
    let seen = on_terminal("");
    for part in ["400 bodies (", "3 regions, ", "ghosts", "transfers", "ms a step", "r2 ", "all "] {
        assert!(seen.contains(part), "`{part}` is missing in {seen}");
    }
    for quiet in ["--quiet", "--json"] {
        assert!(!on_terminal(quiet).contains("ms a step"), "{quiet}");
    }
}

#[test]
fn shells_and_manuals_learn_of_every_subcommand() {
    let said = |args: &[&str]| {
        let output = dcd(args);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{args:?}");
        text(&output.stdout)
    };
    assert!(said(&["completions", "bash"]).contains("--island-limit"));
    assert!(said(&["completions", "fish"]).contains("-l island-limit"));
    assert!(said(&["man"]).starts_with(".ie"));
    let folder = tempfile::tempdir().unwrap();
    said(&["man", "--quiet", "--out", folder.path().join("new/man1").to_str().unwrap()]);
    let run = std::fs::read_to_string(folder.path().join("new/man1/dcd-run.1")).unwrap();
    assert!(run.contains(r"\-\-save"), "{run}");
    assert!(error(&["completions", "csh"], 2).contains("possible values: bash"));
}

#[test]
fn wrong_usage_names_cause_and_remedy_and_exits_with_2() {
    let cases: [(&[&str], &[&str]); 19] = [
        (&["run", "towr"], &["no scene `towr`", "did you mean `tower`?"]),
        (&["run", "tower", "--set", "m=1"], &["no parameter `m`", "top_mass_ratio=1"]),
        (&["run", "tower", "--set", "n=0"], &["`n=0` is not a whole number from 1 to 1000"]),
        (&["run", "tower", "--set", "n"], &["`n` is not a parameter", "name=value"]),
        (&["run", "tower", "--cut", "y=99"], &["plane y=99 cuts no region", "y from -1 to 11"]),
        (&["run", "tower", "--cut", "y=2", "--cut", "y=2"], &["plane y=2 cuts no region", "each plane once"]),
        (&["run", "tower", "--cut", "w=1"], &["write an axis and metres"]),
        (&["run", "tower", "--cut", "x=0", "--regions", "2"], &["cannot be used with"]),
        (&["run", "tower", "--regions", "257"], &["257 is not in 0..=256"]),
        (&["run", "tower", "--coupling", "magic"], &["possible values: proxy, owner, overlap, island, auto"]),
        (&["run", "tower", "--coupling", "auto", "--preset", "game"], &["cannot be used with"]),
        (&["run", "tower", "--preset", "fine"], &["possible values: draft, game, precise"]),
        (&["run", "tower", "--exchanges", "65"], &["65 is not in 1..=64"]),
        (&["run", "tower", "--depth", "0"], &["0 is not in 1..=16"]),
        (&["run", "tower", "--island-limit", "65535"], &["65535 is not in 0..=65534"]),
        (&["run", "tower", "--tolerance", "nan"], &["write metres per second above 0, as 0.03"]),
        (&["run", "tower", "--threads", "0"], &["0 is not in 1..=1024"]),
        (&["run", "tower", "--seconds", "nan"], &["write simulated seconds"]),
        (&["rnu"], &["unrecognized subcommand 'rnu'"]),
    ];
    for (args, expected) in cases {
        let error = error(args, 2);
        for part in expected {
            assert!(error.contains(part), "{args:?}: {error}");
        }
    }
}

#[test]
fn files_that_cannot_be_read_or_written_are_named_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.toml");
    std::fs::write(&broken, "[world]\ngravty = [0, 0, 0]\n").unwrap();
    let said = error(&["run", broken.to_str().unwrap()], 2);
    assert!(
        said.contains("broken.toml:2: unknown field `gravty`") && said.contains("correct the key"),
        "{said}"
    );
    let said = error(&["run", "nowhere.toml"], 2);
    assert!(said.contains("cannot read scene file nowhere.toml"), "{said}");
    // If the error came late, a run this long would never end.
    let out = folder.path().join("no/such/folder.csv");
    let said = error(&["run", "tower", "--seconds", "1e9", "--out", out.to_str().unwrap()], 2);
    assert!(
        said.contains("folder.csv") && said.contains("give --out a file in a folder that exists"),
        "{said}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full_at_the_end_does_not_cost_the_report() {
    let output = dcd(&["run", "tower", "--seconds", "0.1", "--json", "--out", "/dev/full"]);
    assert_eq!(output.status.code(), Some(1));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["bodies"], 10);
    assert!(text(&output.stderr).starts_with("error: cannot write /dev/full"), "{}", text(&output.stderr));
    let full = std::fs::File::create("/dev/full").unwrap();
    let help = Command::new(BINARY).arg("--help").stdout(full).output().unwrap();
    assert_eq!(help.status.code(), Some(1));
    assert!(text(&help.stderr).starts_with("error: cannot print: "), "{}", text(&help.stderr));
}

#[test]
fn help_teaches_and_goes_to_standard_output() {
    for (args, parts) in [
        (&["--help"][..], &["run", "scenes", "Exit codes: 0 done", "130"][..]),
        (
            &["run", "--help"],
            &[
                "dcd run pile",
                "--cut <AXIS=VALUE>",
                "top_mass_ratio=1",
                "possible values: proxy, owner, overlap, island, auto",
            ],
        ),
        (&["scenes"], &["pyramid: ", "base=20 (a whole number from 1 to 1000)"]),
        (&["scenes", "pile"], &["sleep=0"]),
        (&["scenes", "--format"], &["# Scene files", "[[body.collider]]"]),
        (&["scenes", "--format", "models"], &["MJCF", "URDF"]),
    ] {
        let output = dcd(args);
        assert_eq!(output.status.code(), Some(0));
        let stdout = text(&output.stdout);
        assert!(parts.iter().all(|part| stdout.contains(part)), "{args:?}: {stdout}");
    }
    assert!(error(&["scenes", "pyle"], 2).contains("did you mean `pile`?"));
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_long_run_in_order_with_its_report_and_130() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;

    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.csv");
    let mut child = Command::new(BINARY)
        .args(["run", "pile", "--set", "n=100", "--seconds", "1e9", "--json", "-v", "--out"])
        .arg(&out)
        .env_remove("RUST_LOG")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut log = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("stepping") {
        line.clear();
        assert!(log.read_line(&mut line).unwrap() > 0, "it ended before it began to step");
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = wait_at_most(child, std::time::Duration::from_secs(60));
    assert_eq!(output.status.code(), Some(130));
    let report: Value = serde_json::from_str(text(&output.stdout).trim()).unwrap();
    assert!(report["ticks"].as_u64().unwrap() >= 1);
    assert_eq!((report["lost"].as_u64(), report["bodies"].as_u64()), (Some(0), Some(100)));
    assert_eq!(lines_of(&out), 101);
}

#[cfg(unix)]
fn wait_at_most(child: std::process::Child, limit: std::time::Duration) -> Output {
    let id = child.id().to_string();
    let (done, waiting) = std::sync::mpsc::channel();
    std::thread::spawn(move || done.send(child.wait_with_output()));
    waiting.recv_timeout(limit).map(Result::unwrap).unwrap_or_else(|_| {
        let _ = Command::new("kill").args(["-KILL", &id]).status();
        panic!("it did not end within {limit:?}")
    })
}

fn lines_of(path: &Path) -> usize {
    std::fs::read_to_string(path).unwrap().lines().count()
}

#[test]
fn a_model_file_runs_in_a_hundred_copies_and_says_what_it_lacks() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../dcd/scenes/models");
    let ant = models.join("gymnasium/ant.xml");
    let report =
        json(&["run", ant.to_str().unwrap(), "--set", "copies=100", "--regions", "2", "--seconds", "0.1"]);
    assert_eq!((report["bodies"].as_u64(), report["lost"].as_u64()), (Some(1300), Some(0)));
    let quadruped = models.join("bullet/quadruped.urdf");
    let report = json(&["run", quadruped.to_str().unwrap(), "--set", "ground=1", "--seconds", "0.1"]);
    assert_eq!(report["bodies"], 25);
    let output = dcd(&["run", ant.to_str().unwrap(), "--seconds", "0.1"]);
    assert!(text(&output.stderr).contains("joint armature of"), "{}", text(&output.stderr));
    let said = error(&["run", quadruped.to_str().unwrap(), "--set", "key=1"], 2);
    assert!(said.contains("a URDF has no keyframes"), "{said}");
    let error = error(&["run", "none.urdf"], 2);
    assert!(error.contains("none.urdf"), "{error}");
}
