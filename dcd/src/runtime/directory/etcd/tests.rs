//! Tests the directory against a real etcd.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::cluster::directory::conformance::{self, body, values};
use crate::net::Journal;
use crate::space::BodyId;

#[expect(unreachable_pub, reason = "tests of other crates use it too")]
#[path = "../../../../../tests/src/etcd.rs"]
mod cluster;

mod secured;

use cluster::EtcdCluster;

fn world(place: &str) -> EtcdWorld {
    EtcdWorld::at(EtcdAddress::parse(place).unwrap()).unwrap()
}

/// Opens a world, waiting while another server holds it.
fn open(place: &str, holder: &str) -> EtcdDirectory {
    world(place).open(holder, false, &mut |_| true).unwrap().unwrap()
}

fn place_of(directory: &EtcdDirectory) -> String {
    directory.hold.place()
}

/// Ends a directory like a process that is killed.
fn crash(mut directory: EtcdDirectory) {
    directory.is_lost = true;
    directory.lease.abandon();
}

#[test]
fn an_etcd_without_room_is_named_and_what_helps() {
    let Some(etcd) = EtcdCluster::start_small(100_000) else { return };
    let place = etcd.place("full");
    let mut directory = open(&place, "one");
    let full = (0..10_000).find_map(|value| directory.commit(&body(1, value as u8, true), &[]).err());
    let text = full.expect("there is no room for them all").to_string();
    for part in ["cannot write", "space exceeded", "compact and defragment", "alarm disarm"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn what_etcd_does_late_changes_nothing() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("late");
    let mut directory = open(&place, "one");
    let mut heads = vec![directory.stored.clone()];
    for value in 1..4 {
        directory.commit(&body(1, value, true), &[]).unwrap();
        heads.push(directory.stored.clone());
    }
    let keys = directory.hold.keys();
    let all = Op::Delete(keys.key(&segment_name(0)), keys.key(&segment_name(u64::MAX)));
    // Requests that were made when each of these was the head, and are done now.
    for (then, next) in heads.iter().zip(&heads[1..]) {
        let head = Op::Put(directory.hold.keys().key("head"), next.clone().unwrap());
        assert!(!directory.hold.write_if("head", then.as_deref(), &[all.clone(), head]).unwrap());
    }
    // etcd has done it, but its answer was lost.
    directory.stored = heads[2].clone();
    directory.write_head(directory.head, Vec::new()).unwrap();
    assert_eq!(directory.stored, heads[3]);
    drop(directory);
    assert_eq!(values(&mut open(&place, "two")), [(1, 3)]);
}

#[test]
fn it_does_what_a_directory_does() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let count = AtomicUsize::new(0);
    let new = || {
        let name = format!("world-{}", count.fetch_add(1, Ordering::Relaxed));
        open(&etcd.place(&name), "one")
    };
    let reopen = |directory: EtcdDirectory| {
        let place = place_of(&directory);
        drop(directory);
        open(&place, "one")
    };
    conformance::all(&new, &reopen);
}

#[test]
fn who_stands_by_sees_the_world_that_another_server_holds_as_it_was_stored_last() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("glance");
    let seen = || Glance::at(&world(&place)).world();
    assert_eq!(seen(), None);
    let mut directory = open(&place, "one");
    let mut store = |value: Option<u8>| {
        let writes = vec![(Key::World, value.map(|value| vec![value]))];
        directory.commit(&Batch { writes, durable: true }, &[]).unwrap();
        directory.commit(&body(1, 1, true), &[]).unwrap();
    };
    for value in [1, 2] {
        store(Some(value));
        assert_eq!(seen(), Some(vec![value]));
    }
    store(None);
    assert_eq!(seen(), None);
}

/// Returns a batch larger than a transaction of etcd, in bytes and in number, with values larger than etcd
/// takes.
fn large(stamp: u8) -> Batch {
    let small = (0..3_000).map(|i| (Key::Body(BodyId::persistent(i)), Some(vec![stamp; 300])));
    let large = (3_000..3_003).map(|i| (Key::Body(BodyId::persistent(i)), Some(vec![stamp; 2_000_000])));
    Batch { writes: small.chain(large).collect(), durable: true }
}

#[test]
fn a_batch_that_is_more_than_a_transaction_takes_is_there_whole_or_not_at_all() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("large");
    let mut directory = open(&place, "one");
    directory.commit(&large(1), &[]).unwrap();
    let before = directory.load().unwrap();
    // The server dies when all parts but the last are written.
    let head = directory.head;
    let keys = directory.hold.keys();
    let part = Op::Put(keys.key(&format!("{}/00000000", segment_name(head.next))), vec![7; 1_000]);
    directory.hold.write(&[part]).unwrap();
    crash(directory);
    let mut directory = open(&place, "two");
    assert_eq!(directory.load().unwrap(), before);
    // What follows is not mixed up with what was left.
    directory.commit(&body(1, 2, true), &[]).unwrap();
    drop(directory);
    let mut directory = open(&place, "three");
    assert_eq!(directory.load().unwrap()[1].value, [2]);
    assert_eq!(directory.load().unwrap().len(), before.len());
}

#[test]
fn a_log_that_is_much_longer_than_what_it_says_is_begun_anew() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("log");
    let mut directory = open(&place, "one");
    for stamp in 0..40 {
        let value = Some(vec![stamp; 100_000]);
        let writes = vec![(Key::Body(BodyId::persistent(u32::from(stamp % 2))), value)];
        directory.commit(&Batch { writes, durable: true }, &[]).unwrap();
    }
    assert!(directory.log_bytes < 2 * LOG_BYTES, "{}", directory.log_bytes);
    let Head { first, next, .. } = directory.head;
    assert!(first > 10 && next - first < 20, "{first} {next}");
    let stored = directory.hold.keys().read_range("log/", "log/~").unwrap();
    assert_eq!(stored.len() as u64, next - first, "former segments are removed");
    let before = directory.load().unwrap();
    drop(directory);
    assert_eq!(open(&place, "two").load().unwrap(), before);
}

#[test]
fn who_stands_by_takes_over_and_the_former_holder_is_fenced_out() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("fenced");
    let mut former = open(&place, "one");
    let mut joins = former.journal();
    former.commit(&body(1, 1, true), &[]).unwrap();
    joins.append("first\n").unwrap();
    let mut asked = Vec::new();
    let waits = world(&place).open("two", false, &mut |wait| {
        if let Wait::Held(holder) = wait {
            asked.push(holder);
        }
        asked.len() < 60
    });
    assert!(waits.unwrap().is_none(), "a holder that lives keeps its world");
    assert!(asked.iter().all(|holder| holder == "one"));
    // The holder is stopped.
    former.lease.abandon();
    let start = Instant::now();
    let mut next = open(&place, "two");
    println!("taken over after {:?}", start.elapsed());
    assert!(start.elapsed() < Duration::from_millis(2_500), "{:?}", start.elapsed());
    assert_eq!(values(&mut next), [(1, 1)]);
    let mut joins_of_next = next.journal();
    assert_eq!(joins_of_next.read().unwrap(), "first\n");
    // The former holder goes on without knowing it.
    let deposed = DirectoryError::Deposed { place: place.clone() };
    assert_eq!(former.commit(&body(1, 9, true), &[]), Err(deposed));
    assert!(joins.append("second\n").is_err());
    drop(former);
    next.commit(&body(1, 2, true), &[]).unwrap();
    joins_of_next.replace("third\n").unwrap();
    drop(next);
    let mut last = open(&place, "three");
    assert_eq!(values(&mut last), [(1, 2)]);
    assert_eq!(last.journal().read().unwrap(), "third\n");
}

#[test]
fn who_was_deposed_is_told_so_when_it_makes_sure_of_its_hold() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("deposed");
    let mut former = open(&place, "one");
    assert!(matches!(former.renew(), Ok(Tenure::For(_))));
    let mut keys = Keys::new(EtcdAddress::parse(&place).unwrap()).unwrap();
    let holder = keys.holder();
    let found = keys.gateway.read(&holder).unwrap().unwrap();
    // Tries again if the holder renewed its key meanwhile.
    let mut written = found.written;
    while !keys
        .gateway
        .transact(&[gateway::Compare::Written(holder.clone(), written)], &[Op::delete(&holder)])
        .unwrap()
    {
        written = keys.gateway.read(&holder).unwrap().unwrap().written;
    }
    let start = Instant::now();
    while former.renew().is_ok() {
        assert!(start.elapsed() < Duration::from_secs(10), "it goes on");
        std::thread::yield_now();
    }
    assert_eq!(former.renew(), Err(DirectoryError::Deposed { place }));
}

#[test]
fn a_world_goes_on_while_members_of_the_cluster_are_killed_and_stopped() {
    let Some(mut etcd) = EtcdCluster::start(3) else { return };
    let place = etcd.place("members");
    let mut directory = open(&place, "one");
    etcd.kill(0);
    for value in 0..20 {
        directory.commit(&body(1, value, true), &[]).unwrap();
        directory.renew().unwrap();
    }
    // Without this member there is no majority of three.
    etcd.signal(1, "-STOP");
    let start = Instant::now();
    let resumed = std::thread::scope(|scope| {
        let resumed = scope.spawn(|| {
            std::thread::sleep(Duration::from_secs(2));
            etcd.signal(1, "-CONT");
        });
        directory.commit(&body(1, 20, true), &[]).unwrap();
        directory.renew().unwrap();
        resumed.join()
    });
    resumed.unwrap();
    println!("without a majority for two seconds, it wrote after {:?}", start.elapsed());
    drop(directory);
    assert_eq!(values(&mut open(&place, "two")), [(1, 20)]);
}

#[test]
fn what_is_damaged_is_said_and_a_fresh_world_replaces_it() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    let place = etcd.place("damaged");
    let mut directory = open(&place, "one");
    directory.commit(&body(1, 1, true), &[]).unwrap();
    let keys = directory.hold.keys();
    let (segment, head) = (keys.key(&format!("{}/00000000", segment_name(0))), keys.key("head"));
    directory.hold.write(&[Op::Put(segment, vec![1])]).unwrap();
    crash(directory);
    let error = world(&place).open("two", false, &mut |_| true).map(|_| ()).unwrap_err();
    assert!(matches!(error, DirectoryError::Damaged { .. }), "{error}");
    let mut directory = world(&place).open("two", true, &mut |_| true).unwrap().unwrap();
    assert_eq!(directory.load().unwrap(), []);
    directory.commit(&body(2, 2, true), &[]).unwrap();
    directory.hold.write(&[Op::Put(head, vec![0, 0, 0, 0, 0, 0, 0, 9])]).unwrap();
    crash(directory);
    let error = world(&place).open("three", false, &mut |_| true).map(|_| ()).unwrap_err();
    assert!(matches!(error, DirectoryError::Format { found: 9, known: FORMAT, .. }), "{error}");
}

#[test]
fn an_etcd_that_does_not_answer_is_told_at_once() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let place = format!("etcd://{}/nobody", taken.local_addr().unwrap());
    drop(taken);
    let error = world(&place).authority("key").unwrap_err();
    assert!(error.to_string().contains("nobody: 127.0.0.1"), "{error}");
}
