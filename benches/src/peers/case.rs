//! Lists the scenes of the comparison: towers that land, cubes that fly, boxes that are poured, and a tall
//! pyramid.

use std::error::Error;

use dcd::scene::{Params, Scene};

/// A scene of the library in two sizes.
pub(super) struct Case {
    /// The name in the rows; the library knows the scene by the same name.
    pub(super) name: &'static str,
    full: Size,
    /// The size for `--quick`.
    small: Size,
}

/// The size of a scene, and how long it runs.
pub(super) struct Size {
    params: &'static [&'static str],
    /// The simulated seconds.
    pub(super) seconds: f64,
}

pub(super) const CASES: &[Case] = &[
    Case {
        name: "pile",
        full: Size { params: &["n=20000", "gap=0.3", "jitter=0.2"], seconds: 5.0 },
        small: Size { params: &["n=200", "gap=0.3", "jitter=0.2"], seconds: 3.0 },
    },
    Case {
        name: "dve",
        full: Size { params: &["n=40000", "coverage=0.1", "axis_speed=5"], seconds: 3.0 },
        small: Size { params: &["n=300", "coverage=0.1", "axis_speed=5"], seconds: 2.0 },
    },
    // Boxes are poured into a bin of 25 m, which they fill to the same height.
    Case {
        name: "heap",
        full: Size { params: &["n=10000", "slenderness=1.07"], seconds: 8.0 },
        small: Size { params: &["n=150", "slenderness=1.07"], seconds: 4.0 },
    },
    Case {
        name: "pyramid",
        full: Size { params: &["base=100", "sleep=0"], seconds: 5.0 },
        small: Size { params: &["base=12", "sleep=0"], seconds: 3.0 },
    },
];

impl Case {
    /// Returns the case of this name.
    pub(super) fn named(name: &str) -> Result<&'static Self, String> {
        let names = || CASES.iter().map(|case| case.name).collect::<Vec<_>>().join(", ");
        let found = CASES.iter().find(|case| case.name == name);
        found.ok_or_else(|| format!("no scene `{name}` for all engines; there are {}", names()))
    }

    /// Returns the full or the small size.
    pub(super) fn size(&self, small: bool) -> &Size {
        if small { &self.small } else { &self.full }
    }

    /// Makes the scene, as the library does.
    pub(super) fn scene(&self, small: bool) -> Result<Scene, Box<dyn Error>> {
        Ok(Scene::named(self.name, &Params::from_args(self.size(small).params)?)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peers::bodies::Bodies;

    #[test]
    fn every_case_is_a_scene_that_all_engines_can_hold_in_both_sizes() {
        for case in CASES {
            let bodies = [true, false].map(|small| Bodies::of(&case.scene(small).unwrap()).unwrap());
            assert!(bodies[0].bodies.len() < 500 && bodies[1].bodies.len() > 5_000, "{}", case.name);
        }
    }

    #[test]
    fn an_unknown_scene_names_all() {
        let error = Case::named("heep").err().unwrap();
        assert!(error.contains("pile, dve, heap, pyramid"), "{error}");
    }
}
