//! Tests that a client's own avatar, and what it touches, answer at once to what their user asks, as the world will have it.

use std::time::{Duration, Instant};

use dcd::prelude::*;
use dcd_tests::stage::{PATIENCE, Stage, ms};

/// A floor with a stack of ten boxes.
fn stack() -> World {
    let mut world = World::new(WorldConfig::default()).unwrap();
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(30.0, 0.5, 30.0)).unwrap();
    for i in 0..10 {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 1.0 + i as f32, 0.0));
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
    }
    world
}

/// What a player sees of an avatar in a frame.
#[derive(Clone, Copy, Debug)]
struct Sight {
    x: f64,
    speed: f32,
}

/// Plays for so many frames; `ask` is told the number of the frame.
fn play(stage: &mut Stage, avatar: BodyId, frames: u32, mut ask: impl FnMut(&mut World, u32)) -> Vec<Sight> {
    let mut next = Instant::now();
    let mut seen = Vec::new();
    for frame in 0..frames {
        next += Duration::from_micros(16_667);
        while let Some(left) = next.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            stage.client.poll(left);
        }
        ask(&mut stage.client, frame);
        stage.client.step().unwrap();
        let time = stage.client.view_time();
        let shown = stage.client.movable_bodies_at(&time).find(|body| body.id == avatar).unwrap();
        seen.push(Sight { x: shown.pose.translation[0], speed: shown.velocity.linear[0] });
    }
    seen
}

fn enter(stage: &mut Stage, body: RigidBodyBuilder, collider: ColliderBuilder) -> BodyId {
    let avatar = stage.client.insert(body, collider).unwrap();
    let deadline = Instant::now() + PATIENCE;
    stage.client.view_time();
    stage.wait_ticks(60);
    while stage.client.prediction().is_none_or(|prediction| prediction.bodies == 0) {
        assert!(Instant::now() < deadline, "nothing is predicted");
        stage.wait_ticks(3);
    }
    stage.wait_ticks(60);
    avatar
}

#[test]
fn an_avatar_that_pushes_a_stack_answers_at_once() {
    for weather in [ms(0, 0, 0.0), ms(100, 0, 0.0), ms(100, 20, 0.05), ms(100, 50, 0.05)] {
        let mut stage = Stage::of(stack(), weather);
        let body = RigidBodyBuilder::kinematic_velocity_based().translation(Vector::new(-4.0, 1.2, 0.0));
        let avatar = enter(&mut stage, body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        let before = stage.client.prediction().unwrap();
        let seen = play(&mut stage, avatar, 240, |world, frame| {
            let speed = if frame < 30 { 0.0 } else if frame < 180 { 2.0 } else { -1.0 };
            world.set_velocity(avatar, Velocity::linear([speed, 0.0, 0.0])).unwrap();
        });
        let after = stage.client.prediction().unwrap();
        println!("{weather:?}");
        println!("{before:?}\n{after:?}");
        for (frame, pair) in seen.windows(2).enumerate() {
            if (25..40).contains(&frame) || frame % 20 == 0 {
                println!("{frame} {:.4} {:.2} step {:.4}", pair[1].x, pair[1].speed, pair[1].x - pair[0].x);
            }
        }
    }
}
