//! Tests that the redb directory keeps batches whole through crashes, and refuses damaged files.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use super::*;
use crate::cluster::directory::conformance::{self, body, values};
use crate::space::BodyId;

fn new_folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// Makes a batch of `count` bodies, all with this stamp in their values.
fn bodies(count: u32, stamp: u64, bytes: usize, durable: bool) -> Batch {
    let value = [&stamp.to_be_bytes()[..], &vec![7; bytes - 8]].concat();
    let writes = (0..count).map(|i| (Key::Body(BodyId::persistent(i)), Some(value.clone())));
    Batch { writes: writes.collect(), durable }
}

/// Returns the stamp in the values of all bodies.
fn stamp(directory: &mut RedbDirectory, count: usize) -> u64 {
    let entries = directory.load().unwrap();
    let stamps: Vec<_> = entries.iter().map(|entry| *entry.value.first_chunk().unwrap()).collect();
    assert!(stamps.windows(2).all(|pair| pair[0] == pair[1]), "a batch is there in part");
    assert!([0, count].contains(&stamps.len()), "{}", stamps.len());
    stamps.first().map_or(0, |stamp| u64::from_be_bytes(*stamp))
}

#[test]
fn it_does_what_a_directory_does() {
    let folder = new_folder();
    let count = std::cell::Cell::new(0);
    let new = || {
        count.set(count.get() + 1);
        RedbDirectory::open(&folder.path().join(count.get().to_string())).unwrap()
    };
    conformance::all(&new, &|directory| {
        let path = directory.path.clone();
        drop(directory);
        RedbDirectory::open(path.parent().unwrap()).unwrap()
    });
}

#[test]
fn one_server_at_a_time_holds_a_folder() {
    let folder = new_folder();
    let mut first = RedbDirectory::open(folder.path()).unwrap();
    let error = RedbDirectory::open(folder.path()).err().unwrap();
    assert_eq!(error, DirectoryError::Taken { place: place(&folder.path().join("world.redb")) });
    first.commit(&body(1, 1, false), &[]).unwrap();
    drop(first);
    assert_eq!(values(&mut RedbDirectory::open(folder.path()).unwrap()), [(1, 1)]);
}

#[cfg(unix)]
#[test]
fn its_files_are_for_their_owner_only() {
    use std::os::unix::fs::PermissionsExt;
    let folder = new_folder();
    let _directory = RedbDirectory::open(folder.path()).unwrap();
    for name in ["world.redb", "world.lock"] {
        let mode = std::fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{name}");
    }
}

#[test]
fn what_is_no_world_of_ours_is_refused_and_left_as_it_was() {
    let folder = new_folder();
    let path = folder.path().join("world.redb");
    for content in
        [&b""[..], b"a", b"a letter to a friend, and not a short one at all", &[0; 4096], &[0; 100_000]]
    {
        std::fs::write(&path, content).unwrap();
        let error = RedbDirectory::open(folder.path()).err().unwrap();
        assert!(matches!(error, DirectoryError::Foreign { .. }), "{} bytes: {error}", content.len());
        assert!(error.to_string().contains("world.redb"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), content);
    }
    std::fs::remove_file(&path).unwrap();
    drop(Database::create(&path).unwrap());
    let error = RedbDirectory::open(folder.path()).err().unwrap();
    assert!(matches!(error, DirectoryError::Foreign { .. }), "another program's redb: {error}");
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    let error = RedbDirectory::open(folder.path()).err().unwrap();
    assert!(matches!(error, DirectoryError::Unreadable { .. }), "{error}");
}

#[test]
fn a_file_of_another_format_is_refused() {
    let folder = new_folder();
    let path = folder.path().join("world.redb");
    drop(RedbDirectory::open(folder.path()).unwrap());
    let database = Database::open(&path).unwrap();
    let transaction = database.begin_write().unwrap();
    transaction.open_table(ABOUT).unwrap().insert(FORMAT_ROW, FORMAT + 1).unwrap();
    transaction.commit().unwrap();
    drop(database);
    let error = RedbDirectory::open(folder.path()).err().unwrap();
    assert_eq!(error, DirectoryError::Format { place: place(&path), found: FORMAT + 1, known: FORMAT });
}

#[test]
fn a_beginning_that_was_cut_off_is_begun_again() {
    let folder = new_folder();
    std::fs::write(folder.path().join("world.redb.draft"), "half of").unwrap();
    let mut directory = RedbDirectory::open(folder.path()).unwrap();
    assert_eq!(directory.load().unwrap(), []);
    assert!(!folder.path().join("world.redb.draft").exists());
}

/// Opens a damaged copy and returns the outcome: the stamp of one of the states that were committed durably,
/// or a refusal.
fn open_damaged(folder: &Path, content: &[u8]) -> Result<u64, DirectoryError> {
    let path = folder.join("world.redb");
    // A new file, so that no lock of the former one is left on it.
    let _ = std::fs::remove_file(&path);
    std::fs::write(path, content).unwrap();
    RedbDirectory::open(folder).map(|mut directory| {
        let stamp = stamp(&mut directory, 100);
        directory.commit(&bodies(100, 99, 150, true), &[]).unwrap();
        stamp
    })
}

#[test]
fn a_file_that_is_cut_or_changed_anywhere_is_refused_or_whole() {
    let folder = new_folder();
    let mut directory = RedbDirectory::open(folder.path()).unwrap();
    for stamp in 1..=3 {
        directory.commit(&bodies(100, stamp, 150, true), &[]).unwrap();
    }
    drop(directory);
    let whole = std::fs::read(folder.path().join("world.redb")).unwrap();
    let work = new_folder();
    assert_eq!(open_damaged(work.path(), &whole), Ok(3));
    let mut told = std::collections::BTreeMap::<String, u32>::new();
    let mut tell = |kind: &str, result: Result<u64, DirectoryError>| {
        let said = match result {
            Ok(3) => "whole".to_owned(),
            Ok(older) => format!("silently back at {older}"),
            Err(error) => format!("{error:?}").split(' ').next().unwrap().to_owned(),
        };
        *told.entry(format!("{kind}: {said}")).or_default() += 1;
    };
    for eighth in 0..64 {
        tell("cut", open_damaged(work.path(), &whole[..whole.len() * eighth / 64]));
    }
    // Each byte of the header, and some of all others.
    for place in (0..320).chain((320..whole.len()).step_by(whole.len() / 200)) {
        let mut changed = whole.clone();
        changed[place] ^= 1 << (place % 8);
        tell("a bit", open_damaged(work.path(), &changed));
    }
    println!("{told:#?}");
    assert!(told["cut: Damaged"] > 50 && told["a bit: Damaged"] > 100, "{told:#?}");
    let wrong = ["silently", "Taken", "Unreadable"];
    assert!(!told.keys().any(|said| wrong.iter().any(|wrong| said.contains(wrong))), "{told:#?}");
}

const CHILD: &str = "DCD_TEST_DIRECTORY";
const CHILD_BODIES: u32 = 300;

/// Runs in the process that the next test kills. By itself it does nothing.
#[test]
#[ignore = "is started by another test"]
fn child_writes_until_it_is_killed() {
    let Some(folder) = std::env::var_os(CHILD) else { return };
    let mut directory = RedbDirectory::open(Path::new(&folder)).unwrap();
    let first = stamp(&mut directory, CHILD_BODIES as usize) + 1;
    println!("\nopened {first}");
    for stamp in first.. {
        let durable = stamp % 3 == 0;
        directory.commit(&bodies(CHILD_BODIES, stamp, 150, durable), &[]).unwrap();
        if durable {
            println!("durable {stamp}");
            std::io::stdout().flush().unwrap();
        }
    }
}

#[test]
fn a_process_killed_in_mid_write_keeps_all_durable_batches_and_none_in_part() {
    let folder = new_folder();
    let mut before = 0;
    for round in 0..8 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "runtime::directory::redb::tests::child_writes_until_it_is_killed"])
            .args(["--ignored", "--nocapture"])
            .env(CHILD, folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        let number = |line: &str, word| line.strip_prefix(word).and_then(|n| n.trim().parse::<u64>().ok());
        let opened = lines.find_map(|line| number(&line, "opened ")).unwrap();
        assert!(opened > before, "{opened} {before}");
        let mut durable = 0;
        for _ in 0..=round {
            durable = lines.find_map(|line| number(&line, "durable ")).unwrap();
        }
        assert!(matches!(RedbDirectory::open(folder.path()), Err(DirectoryError::Taken { .. })));
        child.kill().unwrap();
        // What the process printed before it died counts too.
        durable = lines.filter_map(|line| number(&line, "durable ")).last().unwrap_or(durable);
        child.wait().unwrap();
        let mut directory = RedbDirectory::open(folder.path()).unwrap();
        let found = stamp(&mut directory, CHILD_BODIES as usize);
        assert!(found >= durable, "{found} is there, {durable} was committed durably");
        before = found;
    }
}

#[test]
fn a_batch_that_is_not_durable_becomes_so_within_a_second() {
    let folder = new_folder();
    let mut directory = RedbDirectory::open(folder.path()).unwrap();
    let now = directory.synced_at;
    // Postpones the next sync, so that the first commit is too early for it, however long it takes.
    directory.synced_at = now + 3_600 * UNSYNCED;
    directory.commit(&body(1, 1, false), &[]).unwrap();
    let copied = |copy: &Path| {
        std::fs::copy(folder.path().join("world.redb"), copy.join("world.redb")).unwrap();
        values(&mut RedbDirectory::open(copy).unwrap())
    };
    let (early, late) = (new_folder(), new_folder());
    assert_eq!(copied(early.path()), [], "a crash now would undo it");
    directory.synced_at = now.checked_sub(UNSYNCED).unwrap();
    directory.commit(&body(2, 2, false), &[]).unwrap();
    assert_eq!(copied(late.path()), [(1, 1), (2, 2)]);
}

/// `cargo test --release -p dcd --lib -- --ignored --nocapture how_long_checkpoints_take`
#[test]
#[ignore = "measures"]
fn how_long_checkpoints_take() {
    let folder = new_folder();
    let mut directory = RedbDirectory::open(folder.path()).unwrap();
    let ms = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
    let report = |what: &str, mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        let mib =
            std::fs::metadata(folder.path().join("world.redb")).unwrap().len() as f64 / (1 << 20) as f64;
        println!(
            "{what}: median {:.1} ms, worst {:.1} ms; the file has {mib:.1} MiB",
            times[times.len() / 2],
            times[times.len() - 1]
        );
    };
    for (what, count, durable) in [
        ("10,000 bodies, durable", 10_000, true),
        ("10,000 bodies, not durable", 10_000, false),
        ("10,000 bodies, durable again", 10_000, true),
        ("100 bodies of 10,000, durable", 100, true),
        ("100 bodies of 10,000, not durable", 100, false),
        ("one entry, durable", 1, true),
    ] {
        let times = (0..20).map(|i| {
            let batch = bodies(count, i, 150, durable);
            // Keeps the clock from making the batch durable.
            directory.synced_at = Instant::now();
            let start = Instant::now();
            directory.commit(&batch, &[]).unwrap();
            ms(start)
        });
        report(what, times.collect());
    }
    report(
        "load",
        (0..20)
            .map(|_| {
                let start = Instant::now();
                assert_eq!(directory.load().unwrap().len(), 10_000);
                ms(start)
            })
            .collect(),
    );
    drop(directory);
    report(
        "open, with all checksums",
        (0..5)
            .map(|_| {
                let start = Instant::now();
                drop(RedbDirectory::open(folder.path()).unwrap());
                ms(start)
            })
            .collect(),
    );
}
