//! Defines the experiments of balls that collide: two on the border, five in a row.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::Scene;
use dcd::space::{Axis, Bounds};

use super::super::reading::worst;
use super::super::scene::{Case, Experiment, Size, corner};
use super::super::trace::Trace;

/// Two balls that meet head-on at 1 m/s each and touch exactly on the border.
pub(super) const BORDER_PAIR: Experiment = Experiment {
    number: 5,
    name: "border_pair",
    metric: "max |v − v′| of both balls, v′ = (m₁v₁ + m₂v₂ ± m e (v₂ − v₁)) / (m₁ + m₂), m/s",
    cases: border_pair,
    more_regions: &[],
    finer: false,
};

/// Five elastic balls in a row, 1 cm apart. The first strikes; the border runs between the third and the
/// fourth.
pub(super) const CRADLE: Experiment = Experiment {
    number: 6,
    name: "cradle",
    metric: "max |v − (0, 0, 0, 0, v₀)|, m/s",
    cases: cradle,
    more_regions: &[],
    finer: false,
};

const RADIUS_M: f32 = 0.5;

fn border_pair(_: Size) -> Vec<Case> {
    let mut cases = Vec::new();
    for restitution in [0.0, 0.5, 1.0] {
        for mass_kg in [1.0, 10.0, 100.0] {
            let exact = after_impact([1.0, mass_kg], [1.0, -1.0], restitution);
            let mut scene = space("border_pair");
            // They touch after a quarter of a second.
            push_ball(&mut scene, -0.75, 1.0, 1.0, restitution as f32);
            push_ball(&mut scene, 0.75, -1.0, mass_kg as f32, restitution as f32);
            let corner = corner(Axis::ALL, [0.0; 3]);
            let label = format!("e {restitution} 1:{mass_kg}");
            let case = Case::new(label, scene, 1.0, corner, move |trace, _| velocity_error(trace, &exact));
            cases.push(case.in_unit("m/s", 1e-4).within(1e-3).free());
        }
    }
    cases
}

/// Lists two speeds. At 1 m/s one impact follows the other; at 5 m/s all of them fall into one step, and one
/// world is wrong as well.
fn cradle(_: Size) -> Vec<Case> {
    [1.0, 5.0].map(struck_row).into()
}

fn struck_row(speed_m_s: f64) -> Case {
    const PITCH_M: f64 = 1.01;
    let mut scene = space("cradle");
    scene.dt_s = 1.0 / 240.0;
    for i in 0..5 {
        let speed_m_s = if i == 0 { speed_m_s as f32 } else { 0.0 };
        push_ball(&mut scene, (f64::from(i) - 2.5) * PITCH_M, speed_m_s, 1.0, 1.0);
    }
    let exact = [0.0, 0.0, 0.0, 0.0, speed_m_s];
    let cuts = |regions: usize| {
        let across = [0.0, -PITCH_M, PITCH_M].map(|x| (Axis::X, x));
        match regions {
            2 => across[..1].to_vec(),
            4 => across.to_vec(),
            _ => across.into_iter().chain([(Axis::Y, 0.0)]).collect(),
        }
    };
    let label = format!("{speed_m_s} m/s");
    let case = Case::new(label, scene, 1.0, cuts, move |trace, _| velocity_error(trace, &exact));
    case.in_unit("m/s", 1e-4).within(1e-3 * speed_m_s).free()
}

/// Returns the velocities after a central impact with this restitution.
fn after_impact(m: [f64; 2], v: [f64; 2], restitution: f64) -> [f64; 2] {
    let together = (m[0] * v[0] + m[1] * v[1]) / (m[0] + m[1]);
    let apart = restitution * (v[1] - v[0]) / (m[0] + m[1]);
    [together + m[1] * apart, together - m[0] * apart]
}

fn velocity_error(trace: &Trace, exact_x: &[f64]) -> f64 {
    let last = trace.last();
    worst(exact_x.iter().enumerate().flat_map(|(body, exact)| {
        let v = last.velocity(body);
        [v[0] - exact, v[1], v[2]].map(f64::abs)
    }))
}

fn space(name: &str) -> Scene {
    let mut scene = Scene::empty(name);
    scene.gravity = [0.0; 3];
    scene.bounds = Bounds::around([0.0; 3], [5.0; 3]);
    scene
}

/// Adds a frictionless ball on the x axis.
fn push_ball(scene: &mut Scene, x: f64, speed_m_s: f32, mass_kg: f32, restitution: f32) {
    let body = RigidBodyBuilder::dynamic().linvel(Vector::new(speed_m_s, 0.0, 0.0)).can_sleep(false);
    let ball = ColliderBuilder::ball(RADIUS_M).mass(mass_kg).restitution(restitution).friction(0.0);
    scene.push(WorldPose::at([x, 0.0, 0.0]), body, ball);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impact_keeps_momentum_and_the_share_of_speed_that_it_should() {
        assert_eq!(after_impact([1.0, 1.0], [1.0, -1.0], 1.0), [-1.0, 1.0]);
        assert_eq!(after_impact([1.0, 1.0], [1.0, -1.0], 0.0), [0.0, 0.0]);
        let [a, b] = after_impact([1.0, 100.0], [1.0, -1.0], 0.5);
        assert!((a + 100.0 * b + 99.0).abs() < 1e-12);
        assert!((b - a - 0.5 * 2.0).abs() < 1e-12);
    }
}
