//! Lists the scenes: what is run, for how long, and what is compared with one world.

use std::error::Error;
use std::ops::Range;

use dcd::protocol::WorldPose;
use dcd::runtime::measure::Plan;
use dcd::scene::{Params, Scene};

use super::statistic::Statistic::{self, *};
use crate::accuracy;

/// A scene of the library in two sizes.
pub(super) struct Case {
    /// The name in the rows.
    pub(super) name: &'static str,
    library: &'static str,
    full: Size,
    /// The size for `--quick`, and to count instructions.
    small: Size,
    /// The figures on which one world's own runs agree, however chaotic the scene is.
    pub(super) statistics: &'static [Statistic],
}

/// The size of a scene, and how long it runs.
pub(super) struct Size {
    params: &'static [&'static str],
    /// The simulated seconds.
    pub(super) seconds: f64,
    /// The part of these seconds that is timed, short enough for six runs of all settings in six minutes on
    /// two cores.
    pub(super) timed: Range<f64>,
}

/// The scenes of `--quick`.
pub(super) const QUICK: [&str; 3] = ["rubble", "gas", "domino_ring"];

pub(super) const CASES: &[Case] = &[
    // Towers that land, with little at borders.
    Case {
        name: "pile",
        library: "pile",
        full: Size { params: &["n=20000", "sleep=0"], seconds: 4.0, timed: 0.0..4.0 },
        small: Size { params: &["n=200", "sleep=0"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[MeanHeight, Displacement, MeanDepth, DepthOf99, Deepest, GroundForce],
    },
    // Towers that lean and fall into one another: bodies at every border.
    Case {
        name: "rubble",
        library: "pile",
        full: Size {
            params: &["n=20000", "gap=0.3", "jitter=0.2", "lean=0.12"],
            seconds: 5.0,
            timed: 3.4..5.0,
        },
        small: Size {
            params: &["n=200", "gap=0.3", "jitter=0.2", "lean=0.12"],
            seconds: 4.0,
            timed: 0.0..4.0,
        },
        statistics: &[MeanHeight, HighestTenth, MeanDepth, DepthOf99, Deepest, GroundForce],
    },
    Case {
        name: "dve",
        library: "dve",
        full: Size { params: &["n=40000", "coverage=0.1", "axis_speed=5"], seconds: 3.0, timed: 0.0..1.0 },
        small: Size { params: &["n=300", "coverage=0.1", "axis_speed=5"], seconds: 2.0, timed: 0.0..2.0 },
        statistics: &[Energy, Momentum, MeanDepth],
    },
    Case {
        name: "gas",
        library: "gas",
        full: Size {
            params: &["n=20000", "cubes=0.5", "fill=0.1", "speed=5"],
            seconds: 3.0,
            timed: 0.0..1.6,
        },
        small: Size { params: &["n=300", "cubes=0.5", "fill=0.1", "speed=5"], seconds: 2.0, timed: 0.0..2.0 },
        statistics: &[Energy, Momentum, MeanDepth],
    },
    // Boxes are poured into a bin of 25 m, which they fill to the same height.
    Case {
        name: "pour",
        library: "heap",
        full: Size { params: &["n=10000", "slenderness=1.07"], seconds: 8.0, timed: 4.0..8.0 },
        small: Size { params: &["n=150", "slenderness=1.07"], seconds: 4.0, timed: 0.0..4.0 },
        statistics: &[MeanHeight, HighestTenth, Motion, MeanDepth, DepthOf99, GroundForce],
    },
    Case {
        name: "mixed",
        library: "heap",
        full: Size { params: &["n=5000", "mixed=1"], seconds: 6.0, timed: 2.0..6.0 },
        small: Size { params: &["n=150", "mixed=1"], seconds: 4.0, timed: 0.0..4.0 },
        statistics: &[MeanHeight, HighestTenth, Motion, MeanDepth, DepthOf99],
    },
    Case {
        name: "pyramid",
        library: "pyramid",
        full: Size { params: &["base=100", "sleep=0"], seconds: 5.0, timed: 0.0..5.0 },
        small: Size { params: &["base=12", "sleep=0"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[MeanHeight, Displacement, MeanDepth, DepthOf99, Deepest, GroundForce],
    },
    Case {
        name: "wall",
        library: "wall",
        full: Size { params: &["width=500", "height=20", "shot=40"], seconds: 5.0, timed: 0.0..4.0 },
        small: Size { params: &["width=16", "height=6", "shot=40"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[MeanHeight, Displaced, MeanDepth, Asleep],
    },
    Case {
        name: "vault",
        library: "vault",
        full: Size { params: &["arches=12", "rows=10", "sleep=0"], seconds: 10.0, timed: 0.0..10.0 },
        small: Size { params: &["arches=3", "rows=1", "sleep=0"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[MeanHeight, Displacement, Displaced, Deepest, GroundForce],
    },
    Case {
        name: "conveyor",
        library: "conveyor",
        full: Size { params: &["n=6000", "belts=20"], seconds: 6.0, timed: 0.0..6.0 },
        small: Size { params: &["n=120", "belts=4"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[Travel, MeanHeight, Motion, MeanDepth],
    },
    Case {
        name: "drum",
        library: "drum",
        full: Size { params: &["n=3000"], seconds: 6.0, timed: 1.0..6.0 },
        small: Size { params: &["n=100"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[MeanHeight, HighestTenth, Motion, MeanDepth, DepthOf99],
    },
    // One island and one assembly.
    Case {
        name: "net",
        library: "net",
        full: Size { params: &["edge=50"], seconds: 4.0, timed: 0.0..4.0 },
        small: Size { params: &["edge=17"], seconds: 3.0, timed: 0.0..3.0 },
        statistics: &[MeanHeight, Gap, Motion],
    },
    Case {
        name: "domino_ring",
        library: "domino_ring",
        full: Size { params: &["n=4000", "starts=40"], seconds: 20.0, timed: 0.0..20.0 },
        small: Size { params: &["n=80", "starts=4"], seconds: 10.0, timed: 0.0..10.0 },
        statistics: &[Fallen, MeanHeight, Asleep],
    },
];

/// Returns all names, for errors.
pub(super) fn names() -> String {
    CASES.iter().map(|case| case.name).collect::<Vec<_>>().join(", ")
}

impl Case {
    /// Returns the case of this name.
    pub(super) fn named(name: &str) -> Result<&'static Self, String> {
        let found = CASES.iter().find(|case| case.name == name);
        found.ok_or_else(|| format!("no scene `{name}` at scale; there are {}", names()))
    }

    /// Returns the full or the small size.
    pub(super) fn size(&self, small: bool) -> &Size {
        if small { &self.small } else { &self.full }
    }

    /// Makes the scene, as the library does.
    pub(super) fn scene(&self, small: bool) -> Result<Scene, Box<dyn Error>> {
        Ok(Scene::named(self.library, &Params::from_args(self.size(small).params)?)?)
    }

    /// Makes the scene as one bare world has it where the timed part begins, so that all settings are timed
    /// from the same state.
    pub(super) fn timed_scene(&self, small: bool) -> Result<Scene, Box<dyn Error>> {
        let (mut scene, start_s) = (self.scene(small)?, self.size(small).timed.start);
        if start_s == 0.0 {
            return Ok(scene);
        }
        let mut world = scene.bare_world();
        for _ in 0..Plan::ticks_of(start_s, scene.dt_s) {
            world.step();
        }
        for (start, (_, body)) in scene.bodies.iter_mut().zip(world.rigid_bodies()) {
            start.pose = WorldPose {
                translation: body.translation().to_array().map(f64::from),
                rotation: body.rotation().to_array(),
            };
            start.body = start.body.clone().linvel(body.linvel()).angvel(body.angvel());
        }
        Ok(scene)
    }

    /// Returns the number of steps of the timed part.
    pub(super) fn timed_ticks(&self, small: bool, dt_s: f32) -> usize {
        let Range { start, end } = self.size(small).timed;
        Plan::ticks_of(end - start, dt_s) as usize
    }

    /// Makes a case for the machinery of `accuracy`, which runs it and looks at it. Planes are the setting's,
    /// not the case's.
    pub(super) fn for_accuracy(&self, scene: Scene, seconds: f64) -> accuracy::Case {
        /// The simulated seconds between looks: enough for a mean over the last second.
        const LOOK_S: f64 = 0.25;
        let weighs = self.statistics.contains(&GroundForce);
        let no_planes = |_| Vec::new();
        let case = accuracy::Case::new(self.name, scene, seconds, no_planes, |_, _| 0.0);
        accuracy::Case { look_s: LOOK_S, rests: weighs, ..case }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_a_scene_of_the_library_in_both_sizes() {
        for case in CASES {
            let bodies = [true, false].map(|small| case.scene(small).unwrap().bodies.len());
            assert!(bodies[0] < 500 && bodies[1] > 1_000, "{}: {bodies:?}", case.name);
            assert!(case.size(true).seconds <= case.size(false).seconds, "{}", case.name);
            for size in [true, false].map(|small| case.size(small)) {
                assert!(size.timed.start >= 0.0 && size.timed.end <= size.seconds, "{}", case.name);
                assert!(
                    size.timed.end - size.timed.start >= 1.0,
                    "{}: the warm-up is half a second",
                    case.name
                );
            }
        }
        assert!(QUICK.iter().all(|name| Case::named(name).is_ok()));
    }

    #[test]
    fn what_is_timed_starts_where_one_bare_world_is_by_then() {
        let size = |params| Size { params, seconds: 2.0, timed: 0.5..1.5 };
        let [full, small] = [0; 2].map(|_| size(&["n=150", "slenderness=1.07"]));
        let case = Case { name: "pour", library: "heap", full, small, statistics: &[] };
        let (start, later) = (case.scene(true).unwrap(), case.timed_scene(true).unwrap());
        let height = |scene: &Scene| scene.bodies.iter().map(|body| body.pose.translation[1]).sum::<f64>();
        assert_eq!(start.bodies.len(), later.bodies.len());
        assert!(height(&later) < height(&start), "{} {}", height(&later), height(&start));
        assert!(later.bodies.iter().any(|body| body.body.linvel.length() > 1.0), "they fall");
        assert_eq!(case.timed_ticks(true, start.dt_s), 60);
    }

    #[test]
    fn an_unknown_scene_names_all() {
        let error = Case::named("rubbel").err().unwrap();
        assert!(error.contains("pile, rubble, dve"), "{error}");
    }
}
