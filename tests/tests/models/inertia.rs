//! Tests that bodies of model files turn as their shapes say, however small, turned or round.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;

use dcd::physics::Measured;
use dcd::runtime::{LocalWorld, WorldConfig};
use dcd::space::BodyId;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use rapier3d::glamx::glam::{DMat3, DQuat, DVec3};

use crate::compare::scene;

/// A geom of density 1,000: its kind, its half-lengths, and where it is in its body.
#[derive(Clone, Debug)]
struct Geom {
    kind: &'static str,
    half: DVec3,
    at: DVec3,
    turn: DQuat,
}

impl Geom {
    fn text(&self) -> String {
        let Self { kind, half, at, turn } = self;
        format!(
            r#"<geom type="{kind}" size="{} {} {}" pos="{} {} {}" quat="{} {} {} {}" density="1000"/>"#,
            half.x, half.y, half.z, at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z
        )
    }

    /// Returns the mass, and the moments about the geom's own axes.
    fn mass(&self) -> (f64, DVec3) {
        let DVec3 { x, y, z } = self.half;
        match self.kind {
            "box" => {
                let kg = 8000.0 * x * y * z;
                (kg, DVec3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (kg / 3.0))
            }
            // Radius and half the length.
            "cylinder" => {
                let kg = 2000.0 * PI * x * x * y;
                let across = x * x / 4.0 + y * y / 3.0;
                (kg, DVec3::new(across, across, x * x / 2.0) * kg)
            }
            _ => {
                let (middle, ends) = (2000.0 * PI * x * x * y, 4000.0 / 3.0 * PI * x * x * x);
                let across =
                    middle * (x * x / 4.0 + y * y / 3.0) + ends * (0.4 * x * x + y * y + 0.75 * x * y);
                (middle + ends, DVec3::new(across, across, (middle / 2.0 + ends * 0.4) * x * x))
            }
        }
    }
}

/// Returns the tensor of a body of these geoms about its centre of mass.
fn tensor(geoms: &[Geom]) -> DMat3 {
    let kg: f64 = geoms.iter().map(|geom| geom.mass().0).sum();
    let centre = geoms.iter().map(|geom| geom.at * (geom.mass().0 / kg)).sum::<DVec3>();
    let of = |geom: &Geom| {
        let ((kg, moments), arm) = (geom.mass(), geom.at - centre);
        let turn = DMat3::from_quat(geom.turn);
        let outer = DMat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
        let shifted = (DMat3::from_diagonal(DVec3::splat(arm.length_squared())) - outer) * kg;
        turn * DMat3::from_diagonal(moments) * turn.transpose() + shifted
    };
    geoms.iter().map(of).sum()
}

/// A body of one to three geoms, of 5 mm to 1 m, some with two equal edges.
fn body() -> impl Strategy<Value = Vec<Geom>> {
    let size = (-2.6..-0.3f64).prop_map(|power| 10f64.powf(power));
    let geom = (
        prop::sample::select(vec!["box", "cylinder", "capsule"]),
        prop::array::uniform3(0.3..1.0f64),
        0..4,
        prop::array::uniform3(-1.0..1.0f64),
        prop::array::uniform3(0.0..TAU),
    );
    (size, prop::collection::vec(geom, 1..4)).prop_map(|(size, geoms)| {
        let geom = |(kind, [x, y, z], equal, at, [a, b, c]): (_, [f64; 3], _, [f64; 3], [f64; 3])| {
            let half = match equal {
                0 => DVec3::new(x, x, z),
                1 => DVec3::new(x, y, y),
                _ => DVec3::new(x, y, z),
            };
            let turn = DQuat::from_rotation_x(a) * DQuat::from_rotation_y(b) * DQuat::from_rotation_z(c);
            Geom { kind, half: half * size, at: DVec3::from_array(at) * size, turn }
        };
        geoms.into_iter().map(geom).collect()
    })
}

#[test]
fn bodies_of_any_size_turn_as_their_geoms_say() {
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    let bodies: Vec<_> = (0..300).map(|_| body().new_tree(&mut runner).unwrap().current()).collect();
    let mut text = r#"<mujoco><option gravity="0 0 0"/><worldbody>"#.to_owned();
    for (index, geoms) in bodies.iter().enumerate() {
        let geoms: String = geoms.iter().map(Geom::text).collect();
        write!(text, r#"<body pos="{} 0 0"><freejoint/>{geoms}</body>"#, 4 * index).unwrap();
    }
    text += "</worldbody></mujoco>";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bodies.xml");
    fs::write(&path, text).unwrap();
    let scene = scene(&path, "sleep=0");
    let mut world = LocalWorld::from_scene(&scene, WorldConfig::for_scene(&scene)).unwrap();
    world.step().unwrap();
    let views = world.views();
    let mut seen = 0;
    for (id, body) in views.iter().flat_map(|view| view.owned()) {
        let index = (0..bodies.len()).find(|&index| BodyId::persistent(index as u32) == id).unwrap();
        let right = tensor(&bodies[index]);
        let found = body.mass_properties().local_mprops.reconstruct_inertia_matrix();
        let wrong = (DMat3::from_cols_array(&found.to_cols_array().map(f64::from)) - right).to_cols_array();
        let largest = right.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let error = wrong.into_iter().fold(0.0, |a: f64, b| a.max(b.abs())) / largest;
        assert!(error < 1e-3, "{error}: {:?}", bodies[index]);
        seen += 1;
    }
    assert_eq!(seen, bodies.len());
}
