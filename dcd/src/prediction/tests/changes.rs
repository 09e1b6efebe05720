//! Tests that predictions follow bodies, joints and scenery that are removed or changed.

use super::*;
use crate::protocol::Alteration;

const CRATE: BodyId = BodyId::persistent(0);
const WALL: BodyId = BodyId::persistent(1);
const ROPE: JointId = JointId(7);

/// Creates a game whose avatar is a dynamic box, so that obstacles stop it. Without friction it moves as fast
/// as it is asked to.
fn sliding(describe: impl FnOnce(&mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>)) -> Game {
    let smooth = cube(0.5).map(|it| it.friction(0.0).friction_combine_rule(CoefficientCombineRule::Min));
    let avatar = RigidBodyBuilder::dynamic().lock_rotations();
    let mut game = Game::with_avatar(6, (avatar, smooth), describe);
    game.play(90, |_| Some(0.0));
    game
}

/// Describes a box that the avatar cannot move.
fn heavy_box(shapes: &mut ShapeLibrary, x: f64) -> BodyRecord {
    let body = RigidBodyBuilder::dynamic().build();
    let collider = [ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1e3)];
    shapes.describe(CRATE, WorldPose::at([x, 1.0, 0.0]), &body, &collider).unwrap()
}

/// Describes a wall in the avatar's way.
fn wall(shapes: &mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>) {
    let body = RigidBodyBuilder::fixed().build();
    let collider = [ColliderBuilder::cuboid(0.2, 2.0, 5.0)];
    let wall = shapes.describe(WALL, WorldPose::at([-2.0, 2.5, 0.0]), &body, &collider).unwrap();
    (vec![wall], Vec::new())
}

/// Describes a heavy box 2 m behind the avatar, and a rope of 2.2 m to it.
fn tied(shapes: &mut ShapeLibrary) -> (Vec<BodyRecord>, Vec<JointRecord>) {
    (vec![heavy_box(shapes, -6.0)], vec![rope(2.2)])
}

fn rope(length_m: f32) -> JointRecord {
    crate::physics::joint_record(ROPE, AVATAR, CRATE, &RopeJointBuilder::new(length_m).build().into())
}

impl Game {
    /// Lets the server tell the client something, and gives the client time to notice.
    fn tell(&mut self, message: ToClient) {
        let now = Duration::from_secs_f64((self.world.tick().0 as f64 + 0.4) * DT_S);
        let message = Message::ToClient(ME, message);
        self.client.handle(now, ClientEvent::Message { from: Peer::Server, message });
        self.play(30, |_| Some(0.0));
    }

    /// Walks to the right for two seconds. Returns how far the avatar came, and its largest prediction error,
    /// metres.
    fn walk(&mut self) -> (f64, f64) {
        let x = |game: &Self| game.truth[&game.world.tick().0];
        let from = x(self);
        self.predicted.clear();
        self.play(120, |_| Some(2.0));
        (x(self) - from, self.worst_m())
    }

    /// Walks, and checks that nothing holds the avatar back, and that it is predicted within so many metres.
    fn walks_freely(&mut self, within_m: f64) {
        let (way_m, off_m) = self.walk();
        assert!(way_m > 3.0, "it came {way_m} m far");
        assert!(off_m < within_m, "{off_m} m off");
    }

    /// Walks, and checks that the avatar is stopped within so many metres.
    fn is_stopped(&mut self, within_m: f64) {
        let (way_m, off_m) = self.walk();
        assert!(way_m < within_m, "it came {way_m} m far");
        assert!(off_m < 0.05, "{off_m} m off");
    }

    /// Checks that the small world holds what is predicted, and nothing else.
    fn holds_what_is_near(&self) {
        let predictor = &self.predictor;
        assert!(predictor.host.held_bodies().iter().eq(predictor.near.keys()));
        assert!(predictor.host.scenery().map(|body| &body.id).eq(predictor.scenery.keys()));
    }
}

#[test]
fn a_body_that_is_removed_is_not_brought_back_by_going_back() {
    let mut game = Game::of(6, stack);
    game.play(60, |_| Some(0.0));
    let top = BodyId::persistent(9);
    assert!(game.predictor.host.owned(top).is_some());
    game.world.remove(top);
    game.tell(ToClient::Removed(top));
    game.play(120, to_and_fro);
    assert!(game.predictor.host.owned(top).is_none());
    game.holds_what_is_near();
}

#[test]
fn what_was_removed_stands_in_nobodys_way() {
    let ahead = |shapes: &mut ShapeLibrary| (vec![heavy_box(shapes, -2.5)], Vec::new());
    sliding(ahead).is_stopped(1.0);
    let mut game = sliding(ahead);
    // A late input is corrected by going back, also to ticks before the body is removed.
    game.play(1, |_| Some(0.5));
    game.to_world.iter_mut().for_each(|(at, _)| *at += 15);
    game.play(13, |_| None);
    game.world.remove(CRATE);
    let replays = game.predictor.stats().replays;
    game.tell(ToClient::Removed(CRATE));
    assert!(game.predictor.stats().replays > replays + 3, "it goes back");
    // States that are this near count as told.
    game.walks_freely(2.0 * LIKE_M);
}

/// The avatar leaves behind the posts along the first part of its way.
#[test]
fn the_small_world_does_not_grow_with_the_way() {
    let mut game = Game::of(6, |shapes| {
        let body = RigidBodyBuilder::fixed().build();
        let at = |i: u32| WorldPose::at([f64::from(i) - 8.0, 1.5, 3.0]);
        let post = |i: u32| shapes.describe(BodyId::persistent(i), at(i), &body, &cube(0.25)).unwrap();
        ((0..20).map(post).collect(), Vec::new())
    });
    for i in 0..480 {
        game.play(1, |_| Some(if i / 10 % 2 == 0 { 5.0 } else { 4.0 }));
        // Late inputs are corrected by going back again and again.
        if let Some((at, _)) = game.to_world.back_mut().filter(|_| i % 30 == 0) {
            *at += 15;
        }
        game.holds_what_is_near();
        assert!(i != 60 || game.predictor.scenery.len() > 10, "posts are near");
    }
    assert!(game.predictor.stats().replays > 60, "{:?}", game.predictor.stats());
    assert_eq!(game.predictor.scenery.len(), 1, "the floor alone is left");
}

#[test]
fn a_rope_that_is_removed_holds_nobody() {
    sliding(tied).is_stopped(0.5);
    let mut game = sliding(tied);
    game.world.remove_joint(ROPE);
    game.tell(ToClient::JointRemoved(ROPE));
    game.walks_freely(1e-3);
}

#[test]
fn a_rope_that_is_let_out_holds_as_far_as_it_reaches() {
    let mut game = sliding(tied);
    let longer = Alteration::Joint(Box::new(rope(20.0)));
    game.world.alter(&longer).unwrap();
    game.tell(ToClient::Altered(longer));
    game.walks_freely(1e-3);
}

#[test]
fn a_wall_that_becomes_a_sensor_is_walked_through() {
    sliding(wall).is_stopped(1.5);
    let mut game = sliding(wall);
    let BodyRecord { mut traits, user_data, .. } = game.world.record(WALL).unwrap();
    Arc::make_mut(&mut traits).colliders[0].sensor = true;
    let door = Alteration::Body { body: WALL, traits, user_data, wakes: false };
    game.world.alter(&door).unwrap();
    game.tell(ToClient::Altered(door));
    game.walks_freely(1e-3);
}

#[test]
fn a_wall_that_is_elsewhere_now_stands_there_alone() {
    let mut game = sliding(wall);
    let mut moved = game.world.record(WALL).unwrap();
    moved.state.pose = WorldPose::at([-2.0, 2.5, 12.0]);
    game.world.remove(WALL);
    game.world.insert(vec![moved.clone()], &[]).unwrap();
    game.tell(ToClient::Inserted { body: moved, shapes: Vec::new(), joints: Vec::new() });
    game.walks_freely(1e-3);
}
