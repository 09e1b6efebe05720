//! Tests how an author shows what its program did to a served world before nodes have done it.

use std::cell::Cell;

use super::*;
use crate::sim::{sim_body, sim_world};

/// A record of a world, set by the test.
struct Told {
    body: BodyRecord,
    joint: Option<JointRecord>,
    answered: u64,
    /// How often a body was looked up, plus how many joints were shown.
    looks: Cell<u32>,
}

impl Known for Told {
    fn knows(&self, id: BodyId) -> bool {
        self.body.id == id
    }

    fn body(&self, id: BodyId) -> Option<BodyRecord> {
        self.looks.set(self.looks.get() + 1);
        self.knows(id).then(|| self.body.clone())
    }

    fn for_each_body(&self, look: &mut dyn FnMut(&BodyRecord)) {
        look(&self.body);
    }

    fn shape(&self, _hash: ShapeHash) -> Option<ShapeRecord> {
        None
    }

    fn has_shape(&self, _hash: ShapeHash) -> bool {
        false
    }

    fn joint(&self, id: JointId) -> Option<JointRecord> {
        self.joint.clone().filter(|joint| joint.id == id)
    }

    fn joints(&self) -> Vec<JointRecord> {
        self.joint.iter().inspect(|_| self.looks.set(self.looks.get() + 1)).cloned().collect()
    }

    fn joints_of(&self, body: BodyId) -> Vec<JointRecord> {
        let of_it = self.joint.iter().filter(|joint| [joint.a, joint.b].contains(&body));
        of_it.inspect(|_| self.looks.set(self.looks.get() + 1)).cloned().collect()
    }

    fn tree(&self) -> DistributionTree {
        sim_world(1).tree
    }

    fn answered(&self) -> u64 {
        self.answered
    }
}

#[test]
fn a_change_is_seen_until_it_is_answered_and_then_whatever_is_told() {
    let body = sim_body(BodyId::persistent(0), [0.0; 3]);
    let joint = joint_record(JointId(0), body.id, BodyId::persistent(1), &GenericJoint::default());
    let mut told = Told { body: body.clone(), joint: Some(joint.clone()), answered: 0, looks: Cell::new(0) };
    let mut author = Author::new(Names::Builder(ClientId(1)), (0, 0), 100.0);
    let seen = |author: &Author, told: &Told| {
        let damping = author.known(told, body.id).map(|body| body.traits.linear_damping);
        (damping, author.joints(told)[0].contacts_enabled)
    };
    let before = (Some(0.0), joint.contacts_enabled);
    author.update(&told, body.id, &mut |body| body.set_linear_damping(0.5)).unwrap();
    author.update_joint(&told, JointId(0), &mut |joint| _ = joint.set_contacts_enabled(!before.1)).unwrap();
    assert_eq!(author.take(&told).len(), 2);
    for _ in 0..3 {
        assert_eq!(seen(&author, &told), (Some(0.5), !before.1));
        assert!(author.take(&told).is_empty(), "it is sent once");
    }
    // Meanwhile someone else has changed both.
    told.answered = 1;
    assert!(author.take(&told).is_empty());
    assert_eq!(seen(&author, &told), before);
    // A change that is not sent yet counts as not answered.
    author.update(&told, body.id, &mut |body| body.set_linear_damping(0.25)).unwrap();
    assert_eq!(author.take(&told).len(), 1);
    assert!(author.take(&told).is_empty());
    assert_eq!(seen(&author, &told).0, Some(0.25));
}

#[test]
fn what_is_taken_back_is_sent_to_nobody_and_its_names_are_given_again() {
    let body = sim_body(BodyId::persistent(0), [0.0; 3]);
    let told = Told { body, joint: None, answered: 0, looks: Cell::new(0) };
    for names in [Names::Program, Names::Builder(ClientId(1))] {
        let mut author = Author::new(names, (1, 0), 100.0);
        let (body, ball) = (RigidBodyBuilder::dynamic().build(), [ColliderBuilder::ball(0.5)]);
        let insert = |author: &mut Author| author.insert(WorldPose::default(), &body, &ball, None).unwrap();
        let [_, second, third] = [(); 3].map(|()| insert(&mut author));
        author.take_back(&[second, third]);
        assert_eq!(insert(&mut author), second);
        author.take_back(&[]);
        let ops = author.take(&told);
        let [BuildOp::Insert { bodies, .. }] = &ops[..] else { panic!("one insertion") };
        assert_eq!(bodies.iter().map(|body| body.id.index()).collect::<Vec<_>>(), [1, 2]);
    }
}

#[test]
fn joints_are_there_once_made_and_gone_once_removed_whatever_is_on_record_yet() {
    let mut told = Told {
        body: sim_body(BodyId::persistent(0), [0.0; 3]),
        joint: None,
        answered: 0,
        looks: Cell::new(0),
    };
    let mut author = Author::new(Names::Program, (1, 0), 100.0);
    let (body, ball) = (RigidBodyBuilder::dynamic().build(), [ColliderBuilder::ball(0.5)]);
    let [a, b, c] =
        [0.0, 2.0, 4.0].map(|x| author.insert(WorldPose::at([x, 0.0, 0.0]), &body, &ball, None).unwrap());
    let [first, second] =
        [[a, b], [b, c]].map(|ends| author.insert_joint(&told, ends, &GenericJoint::default()).unwrap());
    let there = |author: &Author, told: &Told| author.joints(told).len();
    assert_eq!(author.take(&told).len(), 1);
    assert!(author.take(&told).is_empty());
    assert_eq!(there(&author, &told), 2);
    author.update_joint(&told, first, &mut |joint| _ = joint.set_contacts_enabled(false)).unwrap();
    let record = author.joint(&told, first).unwrap();
    assert!(!record.contacts_enabled);
    author.remove_joint(&told, first).unwrap();
    assert!(author.joint(&told, first).is_none() && there(&author, &told) == 1);
    assert_eq!(author.take(&told).len(), 1);
    // The record lags: what was made and removed comes onto it, and goes.
    told.joint = Some(record);
    for _ in 0..2 {
        assert!(author.take(&told).is_empty());
        assert!(author.joint(&told, first).is_none() && there(&author, &told) == 1);
        assert!(author.remove_joint(&told, first).is_err(), "it is gone already");
        assert!(author.update_joint(&told, first, &mut |_| {}).is_err());
    }
    (told.joint, told.answered) = (None, 2);
    assert!(author.take(&told).is_empty());
    assert!(author.joint(&told, first).is_none());
    // The joints of one body are found without a look at others.
    let elsewhere = [8, 9].map(BodyId::persistent);
    told.joint = Some(joint_record(JointId(70), elsewhere[0], elsewhere[1], &GenericJoint::default()));
    told.looks.set(0);
    let of = |author: &Author, id| {
        author.joints_of(&told, id).into_iter().map(|joint| joint.id).collect::<Vec<_>>()
    };
    assert_eq!((of(&author, b), of(&author, a)), (vec![second], vec![]));
    assert_eq!(told.looks.get(), 0);
    assert_eq!(of(&author, elsewhere[1]), [JointId(70)]);
    told.joint = None;
    // A joint is removed with either of its bodies.
    author.remove(&told, c).unwrap();
    assert!(author.joint(&told, second).is_none() && there(&author, &told) == 0);
}

#[test]
fn a_joint_wakes_the_bodies_that_it_ties_as_in_a_local_world() {
    let told = Told {
        body: sim_body(BodyId::persistent(0), [0.0; 3]),
        joint: None,
        answered: 0,
        looks: Cell::new(0),
    };
    let mut author = Author::new(Names::Program, (1, 0), 100.0);
    let (body, ball) = (RigidBodyBuilder::dynamic().sleeping(true).build(), [ColliderBuilder::ball(0.5)]);
    let [a, b, alone] =
        [0.0, 2.0, 4.0].map(|x| author.insert(WorldPose::at([x, 0.0, 0.0]), &body, &ball, None).unwrap());
    author.insert_joint(&told, [a, b], &GenericJoint::default()).unwrap();
    let ops = author.take(&told);
    let [BuildOp::Insert { bodies, .. }] = &ops[..] else { panic!("{} ops", ops.len()) };
    let asleep = bodies.iter().filter(|body| body.state.sleeping).map(|body| body.id);
    assert_eq!(asleep.collect::<Vec<_>>(), [alone]);
    assert!(bodies.iter().all(|body| (body.state.still_s > 0.0) == body.state.sleeping));
}

/// A call that a program makes between two steps.
type Deed<'a> = &'a dyn Fn(&mut Author) -> Result<(), Error>;

#[test]
fn what_is_done_to_a_body_counts_in_the_order_in_which_it_was_asked() {
    let body = sim_body(BodyId::persistent(0), [1.0, 0.0, 0.0]);
    let told = &Told { body: body.clone(), joint: None, answered: 0, looks: Cell::new(0) };
    let mut author = Author::new(Names::Program, (1, 0), 100.0);
    let impulse = Push::impulse(body.id, [10.0, 0.0, 0.0]);
    let at_point = Push { point: Some([1.0, 2.0, 0.0]), ..impulse };
    let force = Push::force(body.id, [5.0, 0.0, 0.0], [0.0; 3]);
    let mut sent = |order: &[Deed<'_>]| {
        order.iter().for_each(|call| call(&mut author).unwrap());
        let pushes = author.take(told).into_iter().filter_map(|op| match op {
            BuildOp::Push(push) => Some(push),
            _ => None,
        });
        pushes.collect::<Vec<_>>()
    };
    let push = |push: Push| move |author: &mut Author| author.push(told, &push);
    let (pushes, forces, pushes_there) = (push(impulse), push(force), push(at_point));
    let stops = |author: &mut Author| author.set_velocity(told, body.id, Velocity::default());
    let goes = |author: &mut Author| author.set_pose(told, body.id, WorldPose::at([101.0, 0.0, 0.0]));
    assert_eq!(sent(&[&pushes, &forces, &stops]), [force], "what was pushed before stands still");
    assert_eq!(sent(&[&stops, &pushes]), [impulse]);
    let moved = Push { point: Some([101.0, 2.0, 0.0]), ..impulse };
    assert_eq!(sent(&[&pushes_there, &goes]), [moved], "its arm stays as long");
    assert_eq!(sent(&[&goes, &pushes_there]), [at_point]);
}

#[test]
fn pushes_of_many_bodies_are_sent_in_the_order_in_which_they_were_asked_for() {
    let told = &Told {
        body: sim_body(BodyId::persistent(0), [0.0; 3]),
        joint: None,
        answered: 0,
        looks: Cell::new(0),
    };
    let mut author = Author::new(Names::Program, (1, 0), 100.0);
    let (body, ball) = (RigidBodyBuilder::dynamic().build(), [ColliderBuilder::ball(0.5)]);
    let ids: Vec<_> =
        (0..300).map(|_| author.insert(WorldPose::default(), &body, &ball, None).unwrap()).collect();
    author.take(told);
    let pushes: Vec<_> =
        (0..3_000_u32).map(|i| Push::impulse(ids[(i * 7 % 300) as usize], [i as f32, 0.0, 0.0])).collect();
    pushes.iter().for_each(|push| author.push(told, push).unwrap());
    // The pushes of these two bodies are dropped.
    author.set_velocity(told, ids[3], Velocity::default()).unwrap();
    author.remove(told, ids[5]).unwrap();
    let sent = author.take(told).into_iter().filter_map(|op| match op {
        BuildOp::Push(push) => Some(push),
        _ => None,
    });
    let left = |push: &Push| ![ids[3], ids[5]].contains(&push.body);
    assert_eq!(sent.collect::<Vec<_>>(), pushes.into_iter().filter(left).collect::<Vec<_>>());
}

#[test]
fn bodies_that_are_taken_away_as_they_are_made_leave_the_others_with_their_joints() {
    let told = &Told {
        body: sim_body(BodyId::persistent(0), [0.0; 3]),
        joint: None,
        answered: 0,
        looks: Cell::new(0),
    };
    let mut author = Author::new(Names::Program, (1, 0), 100.0);
    let (body, ball) = (RigidBodyBuilder::dynamic().build(), [ColliderBuilder::ball(0.5)]);
    let ids: Vec<_> =
        (0..100).map(|_| author.insert(WorldPose::default(), &body, &ball, None).unwrap()).collect();
    let tie = |author: &mut Author, ends: &[BodyId]| {
        author.insert_joint(told, [ends[0], ends[1]], &GenericJoint::default()).unwrap()
    };
    let joints: Vec<_> = ids.windows(2).map(|ends| tie(&mut author, ends)).collect();
    ids[..50].iter().for_each(|id| author.remove(told, *id).unwrap());
    author.remove_joint(told, joints[60]).unwrap();
    let is_left = |place: &usize| (50..99).contains(place) && *place != 60;
    let left: Vec<_> = (0..99).filter(is_left).map(|place| joints[place]).collect();
    let there = |author: &Author| author.joints(told).iter().map(|joint| joint.id).collect::<Vec<_>>();
    assert_eq!(there(&author), left);
    let ops = author.take(told);
    let [BuildOp::Insert { bodies, joints: tied, .. }] = &ops[..] else { panic!("{} ops", ops.len()) };
    assert!(bodies.iter().map(|body| body.id).eq(ids[50..].iter().copied()));
    assert!(tied.iter().map(|joint| joint.id).eq(left.iter().copied()));
    assert_eq!(there(&author), left);
    // Joints that are not on record yet are removed as well.
    author.remove(told, ids[70]).unwrap();
    assert_eq!(there(&author).len(), left.len() - 2);
    assert_eq!(author.movable_count(told), 50);
    assert_eq!(author.movable_bodies(told).len(), 50);
}

#[test]
fn all_bodies_are_seen_as_each_is_without_a_look_at_each() {
    let body = sim_body(BodyId::persistent(0), [0.0; 3]);
    let told = Told { body: body.clone(), joint: None, answered: 0, looks: Cell::new(0) };
    let mut author = Author::new(Names::Program, (1, 0), 100.0);
    let ball = [ColliderBuilder::ball(0.5)];
    let insert = |author: &mut Author| {
        author.insert(WorldPose::default(), &RigidBodyBuilder::dynamic().build(), &ball, None).unwrap()
    };
    let awaited = insert(&mut author);
    author.take(&told);
    let fresh = insert(&mut author);
    let there = WorldPose::at([0.0, 7.0, 0.0]);
    author.set_pose(&told, body.id, there).unwrap();
    told.looks.set(0);
    let seen: Vec<_> = author.movable_bodies(&told).iter().map(|body| (body.id, body.pose)).collect();
    assert_eq!(told.looks.get(), 0);
    let as_made = WorldPose::default();
    assert_eq!(seen, [(body.id, there), (awaited, as_made), (fresh, as_made)]);
    author.remove(&told, body.id).unwrap();
    assert_eq!(author.movable_bodies(&told).len(), 2);
}

#[test]
fn a_shape_that_no_message_holds_is_refused_before_it_has_a_body() {
    let mut author = Author::new(Names::Builder(ClientId(1)), (1, 0), 100.0);
    let field = |size: usize| {
        let heights = rapier3d::parry::utils::Array2::new(size, size, vec![0.0; size * size]);
        [ColliderBuilder::heightfield(heights, Vector::new(100.0, 1.0, 100.0))]
    };
    let ground = RigidBodyBuilder::fixed().build();
    let refused = author.insert(WorldPose::at([0.0; 3]), &ground, &field(2_049), None);
    assert!(refused.unwrap_err().to_string().contains("15.5 MiB"));
    author.insert(WorldPose::at([0.0; 3]), &ground, &field(1_000), None).unwrap();
    let told = Told {
        body: sim_body(BodyId::persistent(0), [0.0; 3]),
        joint: None,
        answered: 0,
        looks: Cell::new(0),
    };
    let [BuildOp::Insert { shapes, .. }] = &author.take(&told)[..] else { panic!("one insertion") };
    assert_eq!(shapes.len(), 1, "what was refused is not sent either");
}

#[test]
fn a_program_keeps_the_shapes_that_the_world_has_and_those_of_what_is_on_its_way() {
    let told = Told {
        body: sim_body(BodyId::persistent(900), [0.0; 3]),
        joint: None,
        answered: 0,
        looks: Cell::new(0),
    };
    let mut author = Author::new(Names::Program, (0, 0), 100.0);
    let first = author
        .insert(
            WorldPose::at([0.0; 3]),
            &RigidBodyBuilder::fixed().build(),
            &[ColliderBuilder::ball(9.0)],
            None,
        )
        .unwrap();
    for dug in 0..200u16 {
        let ball = ColliderBuilder::ball(1.0 + 0.01 * f32::from(dug));
        let id = author
            .insert(WorldPose::at([0.0; 3]), &RigidBodyBuilder::fixed().build(), &[ball], None)
            .unwrap();
        author.take(&told);
        author.remove(&told, id).unwrap();
    }
    assert!(author.shapes().len() < 20, "{}", author.shapes().len());
    let shape = author.known(&told, first).unwrap().traits.colliders[0].shape;
    assert!(author.shapes().record_of(shape).is_some(), "it is not on record yet");
}
