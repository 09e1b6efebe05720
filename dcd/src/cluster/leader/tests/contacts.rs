//! Tests that clients are told once of each contact that begins or ends, whoever reports it and leads.

use super::*;

/// Returns whether each contact of which clients are told begins (or ends).
fn told_touches(leader: &mut Leader) -> Vec<bool> {
    let touches = |(_, message)| match message {
        ToClient::Contacts { touches, .. } => touches,
        _ => Vec::new(),
    };
    leader.take_messages().into_iter().flat_map(touches).map(|touch| touch.began).collect()
}

fn touch(began: bool) -> Touch {
    let key = ContactKey { a: BodyId::persistent(1), b: AVATAR, collider_a: 0, collider_b: 0 };
    Touch { key, began, sensor: true, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }
}

#[test]
fn a_contact_seen_by_two_regions_begins_and_ends_once() {
    let mut leader = leader();
    let key = ContactKey { a: BodyId::persistent(3), b: AVATAR, collider_a: 0, collider_b: 0 };
    let touch =
        |began| vec![Touch { key, began, sensor: false, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }];
    let mut told = Vec::new();
    let script = [
        (touch(true), touch(true)),
        (vec![], vec![]),
        (touch(false), vec![]),
        (vec![], touch(false)),
        (touch(true), vec![]),
    ];
    leader.take_messages();
    for (tick, (one, two)) in (1..).zip(script) {
        leader.dispatch(Duration::from_secs(tick)).unwrap();
        both_done(&mut leader, tick, one, two);
        for (client, message) in leader.take_messages() {
            let ToClient::Contacts { tick, touches, .. } = message else { continue };
            told.extend(touches.iter().map(|touch| (client, tick, touch.began)));
        }
    }
    assert_eq!(told, [(CLIENT, Tick(1), true), (CLIENT, Tick(4), false), (CLIENT, Tick(5), true)]);
}

#[test]
fn what_a_removed_body_touched_is_told_that_this_ends() {
    let mut leader = leader();
    leader.dispatch(Duration::ZERO).unwrap();
    both_done(&mut leader, 1, vec![touch(true)], vec![]);
    assert_eq!(told_touches(&mut leader), [true]);
    leader.apply(vec![WorldOp::Remove(BodyId::persistent(1))]);
    leader.dispatch(Duration::from_secs(1)).unwrap();
    both_done(&mut leader, 2, vec![touch(false)], vec![]);
    assert_eq!(told_touches(&mut leader), [false]);
    // A contact of a body with the same id begins anew.
    leader.dispatch(Duration::from_secs(2)).unwrap();
    both_done(&mut leader, 3, vec![], vec![touch(true)]);
    assert_eq!(told_touches(&mut leader), [true]);
}

#[test]
fn who_leads_on_knows_what_touches_and_all_tell_what_the_program_asked_for() {
    for (moves, expected) in [(false, vec![false]), (true, vec![])] {
        let mut former = leader();
        former.dispatch(Duration::ZERO).unwrap();
        both_done(&mut former, 1, vec![touch(true)], vec![]);
        let body = BodyId::persistent(7);
        let push = crate::protocol::Push::impulse(body, [1.0; 3]);
        let asked = [WorldOp::Input(Input { body, ..input(0, 1.0) }), WorldOp::Push(push)];
        former.apply([&asked[..], &[WorldOp::Remove(body)]].concat());
        // All else comes from the server's record.
        assert_eq!(former.undone(), asked);
        let mut leader = leader();
        leader.inherit(former.into_legacy().1, |_| true);
        leader.dispatch(Duration::ZERO).unwrap();
        // A region that another member computes now reports all its contacts anew.
        let (one, two) = if moves { (vec![], vec![touch(false)]) } else { (vec![touch(false)], vec![]) };
        both_done(&mut leader, 1, one, two);
        assert_eq!(told_touches(&mut leader), expected);
    }
}
