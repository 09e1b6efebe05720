//! Maps the error of projectiles that cross several regions per step and meet a thin wall just past a border.

use dcd::physics::Measured as _;
use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::runtime::WorldError;
use dcd::runtime::measure::Subject;
use dcd::scene::{Scene, SceneBody};
use dcd::space::{Axis, BodyId, Bounds};

use super::{BROKEN, Cell, Grid, Kind, step, subject};

pub(super) const KIND: Kind = Kind {
    name: "projectile",
    title: "Projectiles",
    caption: "A ball of radius 0.1 m with continuous collision detection flies 30 m and meets a wall of 2 cm, 5 cm past a border.\n\
              Distance from the straight line at the last step before the wall, or how far behind the wall it is 0.2 s later.\n\
              A step is 1/60 s: at 400 m/s the ball flies 6.7 m in it. The loose wall floats and weighs as much as 500 balls.",
    x_label: "speed, m/s",
    y_label: "width of a region, m",
    scale_label: "metres",
    scale: (1e-4, 10.0),
    grid,
    cell,
};

const FIXED: &str = "fixed wall";
const LOOSE: &str = "loose wall";

/// The place of the border, which is a multiple of every width of regions.
const BORDER_M: f64 = 30.0;
const WALL_M: f64 = BORDER_M + 0.05;
const MIDDLE_M: f64 = WALL_M + 0.01;
const RADIUS_M: f64 = 0.1;

fn grid(quick: bool) -> Grid {
    let (x, y): (&[f64], &[f64]) = if quick {
        (&[50.0, 400.0], &[1.0, 15.0])
    } else {
        (&[25.0, 50.0, 100.0, 200.0, 300.0, 400.0], &[0.5, 1.0, 2.0, 5.0, 10.0, 15.0])
    };
    Grid { panels: vec![FIXED, LOOSE], x: x.to_vec(), y: y.to_vec() }
}

fn cell(cell: &Cell, _quick: bool) -> Result<f64, WorldError> {
    shot(&scene(cell.x, cell.panel == LOOSE), cell)
}

fn shot(scene: &Scene, cell: &Cell) -> Result<f64, WorldError> {
    let places: Vec<_> = (1..).map(|i| f64::from(i) * cell.y).take_while(|&at| at <= BORDER_M).collect();
    let mut planes = Vec::new();
    middle_first(&places, &mut planes);
    let mut subject = subject(scene, cell.method, planes, |_| ())?;
    let place = |subject: &Subject, body: usize| {
        let id = BodyId::persistent(body as u32);
        let state = subject.states().into_iter().find(|state| state.0 == id);
        state.map_or([f64::NAN; 3], |state| state.2.translation)
    };
    let dt_s = f64::from(scene.dt_s);
    // Rapier's continuous detection slows a ball that would touch within the step, so the last free step is
    // the one before.
    let flight = ((WALL_M - RADIUS_M) / (cell.x * dt_s)).floor() as usize;
    step(&mut subject, flight)?;
    let [x, y, z] = place(&subject, 0);
    let free = f64::hypot(x - cell.x * flight as f64 * dt_s, f64::hypot(y, z));
    step(&mut subject, (0.2 / dt_s) as usize)?;
    let wall = if cell.panel == LOOSE { place(&subject, 1)[0] } else { MIDDLE_M };
    let behind = (place(&subject, 0)[0] - wall).max(0.0);
    let worst = free.max(behind);
    Ok(if free.is_finite() && behind.is_finite() { worst } else { BROKEN })
}

/// Orders planes from the middle on: a tree that is cut from one end to the other would be too deep.
fn middle_first(places: &[f64], planes: &mut Vec<(Axis, f64)>) {
    if let Some(&middle) = places.get(places.len() / 2) {
        planes.push((Axis::X, middle));
        middle_first(&places[..places.len() / 2], planes);
        middle_first(&places[places.len() / 2 + 1..], planes);
    }
}

fn scene(speed_m_s: f64, loose: bool) -> Scene {
    let mut scene =
        Scene::named("gas", &dcd::scene::Params::new().with("n", 1)).expect("the library has a gas");
    "projectile".clone_into(&mut scene.name);
    let ball = RigidBodyBuilder::dynamic().linvel(Vector::X * speed_m_s as f32).ccd_enabled(true);
    let wall = ColliderBuilder::cuboid(0.01, 5.0, 5.0);
    scene.bodies = vec![
        SceneBody {
            pose: WorldPose::at([0.0; 3]),
            body: ball,
            colliders: vec![ColliderBuilder::ball(RADIUS_M as f32)],
        },
        SceneBody {
            pose: WorldPose::at([MIDDLE_M, 0.0, 0.0]),
            body: if loose { RigidBodyBuilder::dynamic() } else { RigidBodyBuilder::fixed() },
            colliders: vec![wall],
        },
    ];
    scene.bounds = Bounds::new([-1.0, -5.0, -5.0], [BORDER_M + 5.0, 5.0, 5.0]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_world_stops_a_projectile_at_a_wall_and_without_a_wall_it_is_seen_behind() {
        let cell = Cell { panel: FIXED, method: None, x: 400.0, y: 0.5 };
        let mut scene = scene(cell.x, false);
        assert!(shot(&scene, &cell).unwrap() < 0.01);
        let cut = Cell { method: Some(dcd::physics::Coupling::Owner), ..cell };
        assert!(shot(&scene, &cut).is_ok(), "so many regions can be made");
        scene.bodies.truncate(1);
        assert!(shot(&scene, &cell).unwrap() > 10.0);
    }
}
