//! Tests that an implementation of `Directory` does what the trait promises, whatever stores it.

use super::{Batch, Condition, Directory, DirectoryError, Key, Revision, Tenure};
use crate::protocol::ShapeHash;
use crate::space::{BodyId, GroupId, JointId};

/// Returns a batch that writes one body's value.
pub(crate) fn body(index: u32, value: u8, durable: bool) -> Batch {
    Batch { writes: vec![(Key::Body(BodyId::persistent(index)), Some(vec![value]))], durable }
}

/// Returns the indices of bodies and their values, as read.
pub(crate) fn values(directory: &mut impl Directory) -> Vec<(u32, u8)> {
    let entries = directory.load().unwrap();
    entries
        .iter()
        .map(|entry| match entry.key {
            Key::Body(id) => (id.index(), entry.value[0]),
            other => panic!("{other}"),
        })
        .collect()
}

/// Runs every check on a new directory. `reopen` drops it, as a process that ends in order does, and opens it
/// again.
pub(crate) fn all<D: Directory>(new: &dyn Fn() -> D, reopen: &dyn Fn(D) -> D) {
    a_new_one_is_empty(new());
    entries_come_in_the_order_of_keys(new());
    a_batch_is_written_whole_or_not_at_all(new());
    of_two_writers_one_finds_that_it_has_lost(new());
    later_writes_of_a_batch_win(new());
    what_was_committed_is_there_after_reopening(new(), reopen);
    its_holder_stays_its_holder(new());
}

fn a_new_one_is_empty(mut directory: impl Directory) {
    assert_eq!(directory.load().unwrap(), []);
    assert_eq!(directory.commit(&Batch::default(), &[]), Ok(Revision(1)));
    assert_eq!(directory.load().unwrap(), []);
}

fn entries_come_in_the_order_of_keys(mut directory: impl Directory) {
    let keys = [
        Key::World,
        Key::Group(GroupId(0)),
        Key::Group(GroupId(256)),
        Key::Body(BodyId::persistent(2)),
        Key::Body(BodyId::persistent(256)),
        Key::Body(BodyId::from_bits(u64::MAX)),
        Key::Shape(ShapeHash([7; 16])),
        Key::Joint(JointId(1)),
    ];
    for (i, key) in keys.iter().enumerate().rev() {
        let value = vec![u8::try_from(i).unwrap(); i];
        directory.commit(&Batch { writes: vec![(*key, Some(value))], durable: false }, &[]).unwrap();
    }
    let entries = directory.load().unwrap();
    assert_eq!(entries.iter().map(|entry| entry.key).collect::<Vec<_>>(), keys);
    for (i, entry) in entries.iter().enumerate() {
        assert_eq!(entry.value, vec![u8::try_from(i).unwrap(); i], "a value may be empty");
        assert_eq!(entry.revision.0, (keys.len() - i) as u64, "it has the revision of its commit");
    }
}

fn a_batch_is_written_whole_or_not_at_all(mut directory: impl Directory) {
    let first = directory.commit(&body(1, 1, true), &[]).unwrap();
    let both = Batch {
        writes: vec![
            (Key::Body(BodyId::persistent(1)), None),
            (Key::Body(BodyId::persistent(2)), Some(vec![2])),
        ],
        durable: true,
    };
    let [one, two] = [1, 2].map(|i| Key::Body(BodyId::persistent(i)));
    // The last of several conditions fails.
    let conditions =
        [Condition { key: one, at: Some(first) }, Condition { key: two, at: Some(Revision(99)) }];
    let error = directory.commit(&both, &conditions).unwrap_err();
    let expected = DirectoryError::Changed { key: two, expected: Some(Revision(99)), found: None };
    assert_eq!(error, expected);
    assert_eq!(values(&mut directory), [(1, 1)]);
    let conditions = [Condition { key: one, at: Some(first) }, Condition { key: two, at: None }];
    let second = directory.commit(&both, &conditions).unwrap();
    assert!(second > first);
    assert_eq!(values(&mut directory), [(2, 2)]);
    assert_eq!(directory.load().unwrap()[0].revision, second);
}

fn of_two_writers_one_finds_that_it_has_lost(mut directory: impl Directory) {
    let key = Key::Body(BodyId::persistent(1));
    let absent = [Condition { key, at: None }];
    let first = directory.commit(&body(1, 1, false), &absent).unwrap();
    let lost = DirectoryError::Changed { key, expected: None, found: Some(first) };
    assert_eq!(directory.commit(&body(1, 2, false), &absent), Err(lost));
    let seen = [Condition { key, at: Some(first) }];
    let second = directory.commit(&body(1, 3, false), &seen).unwrap();
    // Writing the same value again gives another revision all the same.
    let third = directory.commit(&body(1, 3, false), &[Condition { key, at: Some(second) }]).unwrap();
    for stale in [first, second] {
        let lost = DirectoryError::Changed { key, expected: Some(stale), found: Some(third) };
        assert_eq!(directory.commit(&body(1, 4, true), &[Condition { key, at: Some(stale) }]), Err(lost));
    }
    assert_eq!(values(&mut directory), [(1, 3)]);
    // The entry was written, removed and written again: a writer that read it before has lost.
    directory.commit(&Batch { writes: vec![(key, None)], durable: false }, &[]).unwrap();
    directory.commit(&body(1, 3, false), &absent).unwrap();
    assert!(directory.commit(&body(1, 4, false), &[Condition { key, at: Some(third) }]).is_err());
}

fn later_writes_of_a_batch_win(mut directory: impl Directory) {
    let key = |i| Key::Body(BodyId::persistent(i));
    let writes = vec![
        (key(1), Some(vec![1])),
        (key(1), Some(vec![2])),
        (key(2), Some(vec![1])),
        (key(2), None),
        (key(3), None),
        (key(3), Some(vec![3])),
    ];
    directory.commit(&Batch { writes, durable: false }, &[]).unwrap();
    assert_eq!(values(&mut directory), [(1, 2), (3, 3)]);
}

fn what_was_committed_is_there_after_reopening<D: Directory>(mut directory: D, reopen: &dyn Fn(D) -> D) {
    directory.commit(&body(1, 1, true), &[]).unwrap();
    directory.commit(&body(2, 2, false), &[]).unwrap();
    let last = directory.commit(&Batch { durable: true, ..Batch::default() }, &[]).unwrap();
    let before = directory.load().unwrap();
    let mut directory = reopen(directory);
    assert_eq!(directory.load().unwrap(), before);
    assert!(directory.commit(&body(1, 3, false), &[]).unwrap() > last, "revisions go on");
    // A process that ends in order loses nothing, even without a durable batch.
    let mut directory = reopen(directory);
    assert_eq!(values(&mut directory), [(1, 3), (2, 2)]);
    let mut directory = reopen(reopen(directory));
    assert_eq!(values(&mut directory), [(1, 3), (2, 2)]);
}

fn its_holder_stays_its_holder(mut directory: impl Directory) {
    for _ in 0..3 {
        match directory.renew().unwrap() {
            Tenure::WhileOpen => {}
            Tenure::For(left) => assert!(!left.is_zero()),
        }
        directory.commit(&body(1, 1, false), &[]).unwrap();
    }
}
