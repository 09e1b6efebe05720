//! Maps which towers stand: by the mass of the top, the height of the tower, and the place of the border.

use dcd::physics::Measured as _;
use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::WorldError;
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, BodyId, RegionId};

use super::{BROKEN, Cell, Grid, Kind, step, subject};

pub(super) const KIND: Kind = Kind {
    name: "tower",
    title: "Towers",
    caption: "Largest distance of any box from where it started, after 10 s. Soft contacts sag by centimetres in any world;\n\
              from half a metre on, the tower has fallen. Awake all the time; the top box is heavier, the others weigh 1 kg.",
    x_label: "mass of the top box in masses of the others",
    y_label: "boxes",
    scale_label: "metres",
    scale: (0.003, 1.0),
    grid,
    cell,
};

const UPRIGHT: &str = "border upright through the middle";
const BETWEEN: &str = "border between the middle boxes";
const ACROSS: &str = "border across the middle box";
const TOP: &str = "border below the top box";
const BOTTOM: &str = "border across the lowest box";

fn grid(quick: bool) -> Grid {
    let (x, y): (&[f64], &[f64]) = if quick {
        (&[1.0, 10.0, 100.0], &[5.0, 10.0])
    } else {
        (&[1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0], &[3.0, 5.0, 8.0, 10.0, 15.0, 20.0])
    };
    Grid { panels: vec![ACROSS, BETWEEN, TOP, BOTTOM, UPRIGHT], x: x.to_vec(), y: y.to_vec() }
}

fn plane(panel: &str, boxes: f64) -> (Axis, f64) {
    let middle = (boxes / 2.0).floor();
    match panel {
        UPRIGHT => (Axis::X, 0.0),
        BETWEEN => (Axis::Y, middle),
        ACROSS => (Axis::Y, middle + 0.5),
        TOP => (Axis::Y, boxes - 1.0),
        BOTTOM => (Axis::Y, 0.5),
        _ => unreachable!("the grid has these panels"),
    }
}

fn cell(cell: &Cell, quick: bool) -> Result<f64, WorldError> {
    let params = Params::new().with("n", cell.y).with("top_mass_ratio", cell.x).with("sleep", 0);
    let scene = Scene::named("tower", &params).expect("the library has towers");
    let mut subject = subject(&scene, cell.method, vec![plane(cell.panel, cell.y)], |_| ())?;
    step(&mut subject, if quick { 120 } else { 600 })?;
    Ok(strayed_m(&scene, &subject.states()))
}

/// Returns the largest distance of a body from where it started.
fn strayed_m(scene: &Scene, states: &[(BodyId, RegionId, WorldPose, Velocity)]) -> f64 {
    let starts = |id: BodyId| scene.bodies[id.bits() as usize].pose.translation;
    let far = states.iter().map(|(id, _, pose, _)| {
        let start = starts(*id);
        (0..3).map(|i| (pose.translation[i] - start[i]).powi(2)).sum::<f64>().sqrt()
    });
    // A comparison would swallow a value that is not a number.
    far.fold(0.0, |worst, far| if far.is_finite() { worst.max(far) } else { BROKEN })
}

#[cfg(test)]
mod tests {
    use dcd::physics::Coupling;

    use super::*;

    #[test]
    fn a_light_tower_of_one_world_stands_and_owner_fells_one_that_it_cuts_in_the_middle() {
        let at = |method, panel| cell(&Cell { panel, method, x: 1.0, y: 10.0 }, false).unwrap();
        assert!(at(None, BETWEEN) < 0.1);
        assert!(at(Some(Coupling::Owner), BETWEEN) > 0.5);
        assert!(at(Some(Coupling::Owner), UPRIGHT) < 0.1);
    }
}
