//! Maps the error of bouncing across a border: by how elastic the balls are, and by the number of exchanges.

use dcd::physics::Measured as _;
use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::runtime::WorldError;
use dcd::scene::{Params, Scene, SceneBody};
use dcd::space::{Axis, Bounds};

use super::{BROKEN, Cell, Grid, Kind, step, subject};

pub(super) const KIND: Kind = Kind {
    name: "restitution",
    title: "Two balls meeting at a border",
    caption: "Velocities after the impact against the closed form, in parts of the speed of approach; the worst of four phases of\n\
              the step. One bare world takes as many steps a tick as regions take exchanges (auto: as many as it may take).",
    x_label: "exchanges a tick",
    y_label: "restitution",
    scale_label: "velocity error / speed of approach",
    scale: (1e-4, 1.0),
    grid,
    cell,
};

const EQUAL: &str = "equal masses";
const UNEQUAL: &str = "masses 1 to 100";
const RADIUS_M: f64 = 0.5;
const SPEED_M_S: f64 = 4.0;

fn grid(quick: bool) -> Grid {
    let (x, y): (&[f64], &[f64]) = if quick {
        (&[1.0, 4.0], &[0.0, 1.0])
    } else {
        (&[1.0, 2.0, 4.0, 8.0], &[0.0, 0.25, 0.5, 0.75, 0.9, 1.0])
    };
    Grid { panels: vec![EQUAL, UNEQUAL], x: x.to_vec(), y: y.to_vec() }
}

fn cell(cell: &Cell, _quick: bool) -> Result<f64, WorldError> {
    let errors = [0.0, 0.25, 0.5, 0.75].map(|phase| impact(cell, phase));
    errors.into_iter().try_fold(0.0, |worst: f64, error| Ok(worst.max(error?)))
}

/// Returns the error of one impact, which begins in this part of a step.
fn impact(cell: &Cell, phase: f64) -> Result<f64, WorldError> {
    let (masses, restitution) = ([1.0, if cell.panel == EQUAL { 1.0 } else { 100.0 }], cell.y);
    let exchanges = cell.x as usize;
    let mut scene = scene(masses, restitution, phase);
    if cell.method.is_none() {
        scene.dt_s /= exchanges as f32;
        scene.solver_iterations = scene.solver_iterations.div_ceil(exchanges);
    }
    let planes = vec![(Axis::X, 0.0)];
    let mut subject = subject(&scene, cell.method, planes, |config| config.step.exchanges = exchanges)?;
    step(&mut subject, (0.4 / f64::from(scene.dt_s)) as usize)?;
    let mut velocities = [f64::NAN; 2];
    for (id, _, _, velocity) in subject.states() {
        velocities[id.bits() as usize] = f64::from(velocity.linear[0]);
    }
    let centre = SPEED_M_S * (masses[0] - masses[1]) / (2.0 * (masses[0] + masses[1]));
    let away = restitution * SPEED_M_S / (masses[0] + masses[1]);
    let exact = [centre - away * masses[1], centre + away * masses[0]];
    let error = (0..2).map(|i| (velocities[i] - exact[i]).abs() / SPEED_M_S);
    Ok(error.fold(0.0, |worst, error| if error.is_finite() { worst.max(error) } else { BROKEN }))
}

fn scene(masses_kg: [f64; 2], restitution: f64, phase: f64) -> Scene {
    let mut scene = Scene::named("gas", &Params::new().with("n", 1)).expect("the library has a gas");
    "pair".clone_into(&mut scene.name);
    // They touch after six steps and a part of one.
    let apart_m = SPEED_M_S * (6.0 + phase) * f64::from(scene.dt_s);
    let ball = |side: f64, mass: f64| SceneBody {
        pose: WorldPose::at([side * (RADIUS_M + 0.5 * apart_m), 0.0, 0.0]),
        body: RigidBodyBuilder::dynamic().linvel(Vector::X * (-0.5 * side * SPEED_M_S) as f32),
        colliders: vec![
            ColliderBuilder::ball(RADIUS_M as f32)
                .mass(mass as f32)
                .restitution(restitution as f32)
                .friction(0.0),
        ],
    };
    scene.bodies = vec![ball(-1.0, masses_kg[0]), ball(1.0, masses_kg[1])];
    scene.bounds = Bounds::around([0.0; 3], [5.0; 3]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_world_meets_the_closed_form_whatever_the_masses() {
        for panel in [EQUAL, UNEQUAL] {
            for restitution in [0.0, 1.0] {
                let cell = Cell { panel, method: None, x: 1.0, y: restitution };
                let error = super::cell(&cell, false).unwrap();
                assert!(error < 0.01, "{panel}, e {restitution}: {error}");
            }
        }
    }
}
