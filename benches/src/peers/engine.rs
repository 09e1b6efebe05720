//! Lists the engines, and sets up a scene in each.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Duration;

use dcd::rapier3d::prelude::PhysicsWorld;
use dcd::runtime::measure::{Cast, Plan, Subject};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig, WorldError};
use dcd::scene::Scene;
use dcd::space::BodyId;

use super::bodies::{Bodies, State};
use super::box3d::Box3d;
use super::jolt::Jolt;
use super::world::{World, timed};

/// An engine that computes a scene, with its settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Engine {
    /// One Rapier world on one thread.
    Rapier,
    /// The same, on Rapier's own `parallel`.
    RapierParallel,
    Box3d,
    Jolt,
    /// The regions that dcd itself chooses for so many threads.
    Dcd,
    /// Two regions, whatever dcd would choose.
    DcdTwoRegions,
}

/// All engines, bare Rapier first: the others are compared with it.
pub(super) const ENGINES: [Engine; 6] =
    [Engine::Rapier, Engine::RapierParallel, Engine::Box3d, Engine::Jolt, Engine::Dcd, Engine::DcdTwoRegions];

impl Engine {
    /// Returns the name in the rows.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Rapier => "rapier",
            Self::RapierParallel => "rapier parallel",
            Self::Box3d => "box3d",
            Self::Jolt => "jolt",
            Self::Dcd => "dcd",
            Self::DcdTwoRegions => "dcd, 2 regions",
        }
    }

    /// Returns the number of threads that it uses, of those that it may use.
    pub(super) const fn threads(self, most: usize) -> usize {
        match self {
            Self::Rapier => 1,
            _ => most,
        }
    }

    /// Sets up the scene before its first step.
    pub(super) fn world(
        self,
        scene: &Scene,
        bodies: &Bodies,
        most_threads: usize,
    ) -> Result<Box<dyn World>, Box<dyn Error>> {
        let threads = self.threads(most_threads);
        let cut = |partitioning| WorldConfig { partitioning, threads, ..WorldConfig::for_scene(scene) };
        let config = match self {
            Self::Box3d => return Ok(Box::new(Box3d::new(bodies, threads)?)),
            Self::Jolt => return Ok(Box::new(Jolt::new(bodies, threads)?)),
            Self::Rapier | Self::RapierParallel => None,
            Self::Dcd => Some(cut(Partitioning::Auto)),
            Self::DcdTwoRegions => Some(cut(Partitioning::Regions(2))),
        };
        let mut subject = Plan { config, ticks: 1 }.subject(scene)?;
        if let Subject::Bare(world) = &mut subject {
            world.configure_thread_pool(threads)?;
        }
        Ok(Box::new(Rapier { subject, movers: Cast::of_scene(scene).bodies }))
    }
}

/// One Rapier world, or a world of several regions.
struct Rapier {
    subject: Subject,
    movers: Vec<BodyId>,
}

impl World for Rapier {
    fn steps(&mut self, ticks: usize) -> Result<Vec<Duration>, Box<dyn Error>> {
        let steps = self.subject.at_home(|subject| {
            timed(ticks, || {
                match subject {
                    Subject::Bare(world) => world.step(),
                    Subject::Regions(world) => world.step()?,
                }
                Ok::<_, WorldError>(())
            })
        })??;
        Ok(steps)
    }

    fn states(&self) -> Vec<State> {
        match &self.subject {
            Subject::Bare(world) => states_of_one(world),
            Subject::Regions(world) => states_of_regions(world, &self.movers),
        }
    }

    fn regions(&self) -> usize {
        match &self.subject {
            Subject::Bare(_) => 0,
            Subject::Regions(world) => world.regions().len(),
        }
    }
}

fn states_of_one(world: &PhysicsWorld) -> Vec<State> {
    let movers = world.rigid_bodies().map(|(_, body)| body).filter(|body| body.is_dynamic());
    movers
        .map(|body| {
            let (place, turn) = (body.translation().to_array(), body.rotation().to_array());
            State::new(place, turn, body.linvel().to_array(), body.angvel().to_array())
        })
        .collect()
}

fn states_of_regions(world: &LocalWorld, movers: &[BodyId]) -> Vec<State> {
    let owned = world.states().map(|(id, _, pose, velocity)| (id, State { pose, velocity }));
    let owned: BTreeMap<BodyId, State> = owned.collect();
    movers.iter().map(|id| owned.get(id).copied().unwrap_or_else(State::gone)).collect()
}

#[cfg(test)]
mod tests {
    use dcd::scene::Params;

    use super::*;

    /// Returns all bodies of a scene after so many steps, by every engine.
    fn after(scene: &Scene, ticks: usize) -> Vec<(Engine, Vec<State>)> {
        let bodies = Bodies::of(scene).unwrap();
        let run = |engine: Engine| {
            let mut world = engine.world(scene, &bodies, 2).unwrap();
            assert_eq!(world.steps(ticks).unwrap().len(), ticks);
            (engine, world.states())
        };
        ENGINES.map(run).into()
    }

    #[test]
    fn a_scene_starts_alike_in_every_engine() {
        let scene = Scene::named("heap", &Params::new().with("n", 40)).unwrap();
        for (engine, states) in after(&scene, 0) {
            // The bodies of the pit come first.
            let starts = scene.bodies[scene.bodies.len() - 40..].iter().map(|body| body.pose);
            assert_eq!(states.len(), 40, "{engine:?}");
            for (state, start) in states.iter().zip(starts) {
                let off = (0..3).map(|i| (state.pose.translation[i] - start.translation[i]).abs());
                assert!(off.fold(0.0, f64::max) < 1e-5, "{engine:?}: {state:?} {start:?}");
                let cosine: f32 = (0..4).map(|i| state.pose.rotation[i] * start.rotation[i]).sum();
                assert!((cosine.abs() - 1.0).abs() < 1e-5, "{engine:?}: {state:?} {start:?}");
            }
        }
    }

    #[test]
    fn a_free_cube_flies_straight_and_a_tower_stands_in_every_engine() {
        let dve = Scene::named("dve", &Params::from_args(["n=1", "coverage=0.00001"]).unwrap()).unwrap();
        let start = dve.bodies[0].body.linvel;
        for (engine, states) in after(&dve, 60) {
            let v = states[0].velocity.linear;
            let off = (0..3).map(|i| (v[i] - start.to_array()[i]).abs()).fold(0.0, f32::max);
            assert!(off < 1e-4, "{engine:?}: {v:?} {start:?}");
        }
        let tower = Scene::named("tower", &Params::from_args(["n=4", "sleep=0"]).unwrap()).unwrap();
        for (engine, states) in after(&tower, 120) {
            assert!((states[3].pose.translation[1] - 3.5).abs() < 0.1, "{engine:?}: {states:?}");
            assert!(states[3].velocity.linear[1].abs() < 0.02, "{engine:?}: {states:?}");
        }
    }
}
