//! Lists the worlds that are timed.

use std::error::Error;

use dcd::protocol::WorldPose;
use dcd::scene::{Params, Scene};

/// A scene of some size, run for a while before it is timed.
pub(super) struct Case {
    pub(super) scene: &'static str,
    pub(super) bodies: usize,
    /// Simulated seconds until the scene is what it is named after.
    pub(super) settle_s: f64,
}

/// How a case is computed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variant {
    /// By Rapier's own `parallel` solver.
    pub(super) parallel: bool,
    /// 0: one bare Rapier world.
    pub(super) regions: usize,
    pub(super) threads: usize,
}

/// Towers, free cubes, and one giant island. The heap stops at 10,000: beyond that it takes minutes to fall and settle.
pub(super) const CASES: &[Case] = &[
    Case { scene: "pile", bodies: 1_000, settle_s: 0.0 },
    Case { scene: "pile", bodies: 5_000, settle_s: 0.0 },
    Case { scene: "pile", bodies: 20_000, settle_s: 0.0 },
    Case { scene: "pile", bodies: 100_000, settle_s: 0.0 },
    Case { scene: "dve", bodies: 1_000, settle_s: 0.0 },
    Case { scene: "dve", bodies: 10_000, settle_s: 0.0 },
    Case { scene: "dve", bodies: 40_000, settle_s: 0.0 },
    Case { scene: "dve", bodies: 100_000, settle_s: 0.0 },
    Case { scene: "heap", bodies: 1_000, settle_s: 4.0 },
    Case { scene: "heap", bodies: 3_000, settle_s: 5.0 },
    Case { scene: "heap", bodies: 10_000, settle_s: 6.0 },
];

pub(super) const QUICK_CASES: &[Case] = &[
    Case { scene: "pile", bodies: 2_000, settle_s: 0.0 },
    Case { scene: "dve", bodies: 4_000, settle_s: 0.0 },
    Case { scene: "heap", bodies: 500, settle_s: 3.0 },
];

/// Scenes in the order of their cases.
pub(super) fn names() -> Vec<&'static str> {
    let mut names: Vec<_> = CASES.iter().map(|case| case.scene).collect();
    names.dedup();
    names
}

/// Ticks that give a median within a second or two; few for large worlds, where every step is long.
pub(super) fn ticks_worth(step_ms: f64, quick: bool) -> usize {
    let (budget_ms, most) = if quick { (300.0, 120.0) } else { (2_000.0, 600.0) };
    (budget_ms / step_ms).clamp(60.0, most) as usize
}

impl Case {
    /// The scene as it is when the clock starts: settled by one bare world, so that all variants start from the same state.
    pub(super) fn scene(&self) -> Result<Scene, Box<dyn Error>> {
        let mut scene = Scene::named(self.scene, &Params::new().with("n", self.bodies))?;
        if self.settle_s > 0.0 {
            let mut world = scene.bare_world();
            for _ in 0..(self.settle_s / f64::from(scene.dt_s)) as usize {
                world.step();
            }
            for (start, (_, body)) in scene.bodies.iter_mut().zip(world.rigid_bodies()) {
                start.pose = WorldPose {
                    translation: body.translation().to_array().map(f64::from),
                    rotation: body.rotation().to_array(),
                };
                start.body = start.body.clone().linvel(body.linvel()).angvel(body.angvel());
            }
        }
        Ok(scene)
    }

    /// The bare world first.
    pub(super) fn variants(&self, quick: bool, threads: usize, with_parallel: bool) -> Vec<Variant> {
        let counts: &[usize] = if quick { &[1, 2, 4] } else { &[1, 2, 4, 8, 16, 32, 64] };
        let regions = |parallel| {
            move |&regions: &usize| Variant {
                parallel,
                regions,
                threads: if parallel { threads } else { threads.min(regions) },
            }
        };
        let mut variants = vec![Variant::bare()];
        variants.extend(counts.iter().map(regions(false)));
        if with_parallel {
            variants.push(Variant::bare_parallel(threads));
            // One region whose world uses all threads.
            variants.extend([1].iter().map(regions(true)));
        }
        variants
    }
}

impl Variant {
    /// One Rapier world on one thread: the reference.
    pub(super) fn bare() -> Self {
        Self { parallel: false, regions: 0, threads: 1 }
    }

    /// One Rapier world on several threads: the other reference.
    pub(super) fn bare_parallel(threads: usize) -> Self {
        Self { parallel: true, regions: 0, threads }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_settled_heap_lies_low_and_almost_still() {
        let case = &QUICK_CASES[2];
        let height = |scene: &Scene| {
            scene.bodies.iter().map(|body| body.pose.translation[1]).fold(f64::NEG_INFINITY, f64::max)
        };
        let raw = Case { settle_s: 0.0, ..*case }.scene().unwrap();
        let settled = case.scene().unwrap();
        assert_eq!(settled.bodies.len(), raw.bodies.len());
        assert!(height(&settled) < 0.9 * height(&raw), "{} {}", height(&settled), height(&raw));
        let fastest = settled.bodies.iter().map(|body| body.body.linvel.length()).fold(0.0, f32::max);
        assert!(fastest < 0.5, "{fastest}");
    }
}
