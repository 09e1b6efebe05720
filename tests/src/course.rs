//! Plays own avatars of each kind through a course, as a player does: sends the inputs of each frame, and
//! records what is shown in it.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use dcd::network::Prediction;
use dcd::prelude::*;
use dcd::{Drive, ViewTime};

use crate::stage::{PATIENCE, Stage};

/// The duration of a frame.
const FRAME: Duration = Duration::from_micros(16_667);

/// A kind of avatar, and what its player does with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// A kinematic box that pushes over a stack of ten boxes.
    Pusher,
    /// A ball that is given a velocity now and then. It knocks boxes about and passes a turning bar.
    Ball,
    /// A character that walks over steps, jumps, and pushes boxes.
    Walker,
    /// A car that drives through boxes and over bumps.
    Driver,
}

impl Course {
    /// All courses.
    pub const ALL: [Self; 4] = [Self::Pusher, Self::Ball, Self::Walker, Self::Driver];

    /// Returns the name of the course.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pusher => "pusher",
            Self::Ball => "ball",
            Self::Walker => "walker",
            Self::Driver => "driver",
        }
    }

    /// Returns the world of the course, with this many additional boxes that lie about.
    pub fn world(self, others: u32) -> World {
        let mut world = World::new(WorldConfig::default()).unwrap();
        let mut block = |at: [f32; 3], half: [f32; 3]| {
            let body = RigidBodyBuilder::fixed().translation(Vector::from_array(at));
            world.insert(body, ColliderBuilder::cuboid(half[0], half[1], half[2])).unwrap();
        };
        block([0.0, 0.0, 0.0], [200.0, 0.5, 200.0]);
        match self {
            Self::Pusher | Self::Ball => {}
            Self::Walker => (0..5u8).for_each(|i| {
                let height = 0.1 * f32::from(i + 1);
                block([1.0 + 0.5 * f32::from(i), 0.5 + height, 0.0], [0.25, height, 2.0]);
            }),
            Self::Driver => {
                (0..6u8).for_each(|i| block([10.0 + 4.0 * f32::from(i), 0.5, 1.0], [0.3, 0.12, 3.0]))
            }
        }
        let mut cube = |at: [f32; 3], half: f32| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::from_array(at));
            world.insert(body, ColliderBuilder::cuboid(half, half, half)).unwrap();
        };
        match self {
            Self::Pusher => (0..10u8).for_each(|i| cube([0.0, 1.0 + f32::from(i), 0.0], 0.5)),
            Self::Ball => (0..12u8).for_each(|i| {
                let (row, column) = (f32::from(i / 4), f32::from(i % 4));
                cube([1.0 + 1.5 * row, 0.8, 1.2 * column - 1.8], 0.3);
            }),
            Self::Walker => (0..4u8).for_each(|i| cube([6.0, 0.8, 0.8 * f32::from(i) - 1.2], 0.3)),
            Self::Driver => {
                (0..6u8).for_each(|i| cube([6.0, 0.9 + 0.8 * f32::from(i / 3), f32::from(i % 3) - 1.0], 0.4))
            }
        }
        let wide = others.isqrt() + 1;
        for i in 0..others {
            let at = [(i % wide) as f32 * 1.6 - 0.8 * wide as f32, 0.9, 6.0 + (i / wide) as f32 * 1.6];
            cube(at, 0.4);
        }
        if self == Self::Ball {
            let bar = RigidBodyBuilder::kinematic_velocity_based()
                .translation(Vector::new(0.0, 1.0, 0.0))
                .angvel(Vector::new(0.0, 1.5, 0.0));
            world.insert(bar, ColliderBuilder::cuboid(2.0, 0.2, 0.1)).unwrap();
        }
        world
    }

    fn enter(self, client: &mut World) -> BodyId {
        let at = WorldPose::at;
        let cube = ColliderBuilder::cuboid(0.5, 0.5, 0.5);
        let kinematic = RigidBodyBuilder::kinematic_velocity_based();
        match self {
            Self::Pusher => client.insert_at(at([-4.0, 1.2, 0.0]), kinematic, [cube]),
            Self::Ball => {
                let body = RigidBodyBuilder::dynamic().can_sleep(false);
                client.insert_at(at([-3.0, 0.9, 0.0]), body, [ColliderBuilder::ball(0.4)])
            }
            Self::Walker => {
                let capsule = ColliderBuilder::capsule_y(0.5, 0.3);
                client.insert_character(at([-2.0, 1.4, 0.3]), &Character::default(), kinematic, [capsule])
            }
            Self::Driver => {
                let chassis = ColliderBuilder::cuboid(1.6, 0.4, 0.8).density(250.0);
                let body = RigidBodyBuilder::dynamic().can_sleep(false);
                client.insert_vehicle(at([-4.0, 1.6, 0.2]), &Vehicle::default(), body, [chassis])
            }
        }
        .unwrap()
    }

    /// Sends the avatar the inputs of this frame.
    fn ask(self, client: &mut World, avatar: BodyId, frame: u32) {
        let go = |client: &mut World, v: [f32; 3]| client.set_velocity(avatar, Velocity::linear(v)).unwrap();
        let turn = frame / 45;
        match self {
            Self::Pusher => go(client, [[0.0, 2.0, 2.0, 2.0, -1.0, 1.5][turn as usize % 6], 0.0, 0.0]),
            // Kicked four times per three seconds.
            Self::Ball if frame % 45 == 30 => {
                let (x, z) = [(5.0, 0.0), (3.0, 3.0), (-4.0, 1.0), (4.0, -4.0)][turn as usize % 4];
                go(client, [x, 1.0, z]);
            }
            Self::Ball => {}
            Self::Walker => {
                let up = if frame % 90 == 60 { 4.0 } else { 0.0 };
                go(client, [[0.0, 3.0, 3.0, 3.0, -2.0, 2.0][turn as usize % 6], up, 0.4]);
            }
            Self::Driver => {
                let throttle = [0.0, 1.0, 1.0, 0.6, -0.5, 1.0][turn as usize % 6];
                let steering = [0.0, 0.0, 0.3, -0.4, 0.0, 0.5][turn as usize % 6];
                client.drive(avatar, Drive { throttle, brake: 0.0, steering }).unwrap();
            }
        }
    }
}

/// What a client shows in a frame.
pub struct Scene {
    /// The ticks that the frame shows.
    pub time: ViewTime,
    /// The shown poses and velocities of the movable bodies.
    pub bodies: BTreeMap<BodyId, (WorldPose, Velocity)>,
    /// The wall time that the frame's predictions took.
    pub predicting: Duration,
}

/// A played course.
pub struct Played {
    /// The player's avatar.
    pub avatar: BodyId,
    /// What was shown, frame by frame.
    pub frames: Vec<Scene>,
    /// The counters of the prediction while the course was played. The largest correction may come from
    /// shortly before.
    pub prediction: Prediction,
}

impl Played {
    /// Returns the share of ticks with a correction above 2 cm.
    pub fn corrected(&self) -> f64 {
        self.prediction.corrections as f64 / self.prediction.ticks.max(1) as f64
    }

    /// Returns the jumps of all moving bodies: by how many metres more than its velocity allows a body moves
    /// from one frame to the next.
    pub fn jumps_m(&self) -> Vec<f64> {
        let mut jumps = Vec::new();
        for pair in self.frames.windows(2) {
            let ticks = pair[1].time.predicted - pair[0].time.predicted;
            for (id, to) in &pair[1].bodies {
                jumps.extend(pair[0].bodies.get(id).and_then(|from| jump_m(from, to, ticks)));
            }
        }
        jumps.sort_unstable_by(f64::total_cmp);
        jumps
    }
}

/// Returns by how many metres more than its velocity allows a body has moved in this many ticks; `None` for a
/// body at rest.
fn jump_m(
    (from, before): &(WorldPose, Velocity),
    (to, after): &(WorldPose, Velocity),
    ticks: f64,
) -> Option<f64> {
    /// A body that is slower than this, and stays nearer, is at rest. Counted as exact, resting bodies would
    /// hide the jumps of others.
    const MOVES_M_S: f64 = 0.01;
    const MOVES_M: f64 = 0.001;
    let norm = |v: [f64; 3]| v.into_iter().map(|v| v * v).sum::<f64>().sqrt();
    let way: [f64; 3] = std::array::from_fn(|i| to.translation[i] - from.translation[i]);
    let is_slow = |velocity: &Velocity| norm(velocity.linear.map(f64::from)) <= MOVES_M_S;
    if is_slow(before) && is_slow(after) && norm(way) <= MOVES_M {
        return None;
    }
    Some(norm(std::array::from_fn(|i| {
        // An impact may lie between the two frames. What approaches or leaves is shown faster or slower for a
        // while.
        let ends = [before, after].map(|v| f64::from(v.linear[i]) * ticks / 60.0);
        let low = ends[0].min(ends[1]).min(0.0) * 1.6;
        let high = ends[0].max(ends[1]).max(0.0) * 1.6;
        way[i] - way[i].clamp(low, high)
    })))
}

/// Plays this many frames of a course.
pub fn play(stage: &mut Stage, course: Course, frames: u32) -> Played {
    let avatar = course.enter(&mut stage.client);
    let deadline = Instant::now() + PATIENCE;
    stage.client.view_time();
    stage.wait_ticks(120);
    let is_there = |client: &World| client.body(avatar).is_some_and(|body| body.owner.is_some());
    while !is_there(&stage.client)
        || stage.client.prediction().is_none_or(|prediction| prediction.bodies == 0)
    {
        assert!(Instant::now() < deadline, "the avatar is not predicted");
        stage.wait_ticks(3);
    }
    stage.wait_ticks(60);
    // Starts the prediction anew, so that it counts from here.
    stage.client.set_prediction(false).unwrap();
    stage.client.set_prediction(true).unwrap();
    while stage.client.prediction().is_none_or(|prediction| prediction.bodies == 0) {
        stage.wait_ticks(3);
    }
    stage.wait_ticks(30);
    let before = stage.client.prediction().unwrap();
    let mut next = Instant::now();
    let mut played = Vec::new();
    for frame in 0..frames {
        next += FRAME;
        while let Some(left) = next.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            stage.client.poll(left);
        }
        course.ask(&mut stage.client, avatar, frame);
        stage.client.step().unwrap();
        let time = stage.client.view_time();
        let bodies = stage.client.movable_bodies_at(&time);
        let bodies = bodies.map(|body| (body.id, (body.pose, body.velocity))).collect();
        let predicting = stage.client.prediction().unwrap().last_frame;
        played.push(Scene { time, bodies, predicting });
    }
    let mut prediction = stage.client.prediction().unwrap();
    prediction.ticks -= before.ticks;
    prediction.replays -= before.replays;
    prediction.corrections -= before.corrections;
    Played { avatar, frames: played, prediction }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Quantiles;

    #[test]
    fn what_rests_hides_no_jump() {
        let at = |x: f64| (WorldPose::at([x, 0.0, 0.0]), Velocity::default());
        let played: Vec<_> = [0.0, 0.1]
            .map(|jump| {
                (0..1_000).map(|i| if i == 0 { at(jump) } else { at(f64::from(i)) }).collect::<Vec<_>>()
            })
            .into();
        let pairs = played[0].iter().zip(&played[1]);
        let jumps: Vec<_> = pairs.filter_map(|(from, to)| jump_m(from, to, 1.0)).collect();
        assert!((Quantiles::from(jumps).at(0.99) - 0.1).abs() < 1e-9);
    }
}
