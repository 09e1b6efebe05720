//! Reduces a run to statistics: figures on which the runs of one world agree, though places of single bodies
//! do not.

use dcd::scene::Scene;

use crate::accuracy::{Better, Figure, Look, Trace, masses_kg, mean_gap_m};

/// One figure of a run. All are means over the run's last second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Statistic {
    /// The energy over that at the start.
    Energy,
    /// The net momentum, |Σ m v| / Σ m |v|.
    Momentum,
    /// The mean height of all bodies.
    MeanHeight,
    /// The height that a tenth of the bodies are above.
    HighestTenth,
    /// The height to which the remaining motion could lift the bodies: mean v² / 2g.
    Motion,
    /// The mean depth of all pairs that touch.
    MeanDepth,
    /// The depth that one pair of a hundred exceeds.
    DepthOf99,
    /// The depth of the deepest pair.
    Deepest,
    /// The force on fixed bodies, over the weight.
    GroundForce,
    /// Mean distance of a body from its start.
    Displacement,
    /// Share of the bodies that are more than 0.25 m, half a brick, from their start.
    Displaced,
    /// Mean distance along x from the start.
    Travel,
    /// Share of the bodies that lean by more than 45°.
    Fallen,
    /// Mean distance between the two anchors of a joint.
    Gap,
    /// Share of the bodies that sleep.
    Asleep,
}

use Statistic::*;

impl Statistic {
    /// Returns the unit and name.
    pub(super) const fn unit(self) -> &'static str {
        match self {
            Energy => "of the energy at the start",
            Momentum => "net momentum, of all that moves",
            MeanHeight => "m, mean height",
            HighestTenth => "m, height of the highest tenth",
            Motion => "m, mean v²/2g",
            MeanDepth => "m, mean penetration",
            DepthOf99 => "m, 99th percentile of penetration",
            Deepest => "m, deepest penetration",
            GroundForce => "ground force over weight",
            Displacement => "m, mean displacement",
            Displaced => "of the bodies, displaced by 0.25 m",
            Travel => "m, mean way along x",
            Fallen => "of the bodies, fallen",
            Gap => "m, mean gap of joints",
            Asleep => "of the bodies, asleep",
        }
    }

    /// Returns the side of one world's mean on which a run is no worse.
    const fn better(self) -> Better {
        match self {
            Energy | GroundForce => Better::Towards(1.0),
            Momentum | Motion | MeanDepth | DepthOf99 | Deepest | Gap => Better::Less,
            _ => Better::Nowhere,
        }
    }

    /// Returns an error that nobody needs less of, which is added to what one world's own runs differ by.
    ///
    /// - **Shares.** One in a hundred; for what happens or does not, two in a thousand.
    /// - **Lengths.** 0.1 mm for means that rest on contacts and joints, as everywhere in the suite; a
    ///   millimetre for single contacts, for places, and for heights that bodies could reach; a centimetre, a
    ///   hundredth of a body, for heights of what falls.
    const fn floor(self) -> f64 {
        match self {
            Energy | Momentum | GroundForce | Displaced | Asleep => 0.01,
            Fallen => 0.002,
            MeanDepth | Gap => 1e-4,
            DepthOf99 | Deepest | Displacement | Motion => 1e-3,
            MeanHeight | HighestTenth | Travel => 0.01,
        }
    }

    /// Returns the figure of a run.
    pub(super) fn figure(self, run: &Trace, subject: &Subject) -> Figure {
        let mean = |of: &dyn Fn(&Look) -> f64| mean(run.tail(1.0).map(of));
        let of_bodies = |of: &dyn Fn(&Look, usize) -> f64| {
            mean(&|look| self::mean(look.moving().map(|body| of(look, body))))
        };
        let from_start = |look: &Look, body: usize| {
            let (now, start) = (look.place(body), run.first().place(body));
            std::array::from_fn::<_, 3, _>(|i| now[i] - start[i])
        };
        let share = |is: bool| f64::from(u8::from(is));
        let value = match self {
            Energy => mean(&|look| look.energy_j / run.first().energy_j),
            Momentum => mean(&|look| net_momentum(look, &subject.masses_kg)),
            MeanHeight => of_bodies(&|look, body| look.place(body)[1]),
            HighestTenth => mean(&|look| {
                let mut heights: Vec<_> = look.moving().map(|body| look.place(body)[1]).collect();
                heights.sort_by(f64::total_cmp);
                at_share(&heights, 0.9)
            }),
            Motion => of_bodies(&|look, body| length(look.velocity(body)).powi(2) / (2.0 * 9.81)),
            MeanDepth => mean(&|look| self::mean(look.depths_m.iter().copied())),
            DepthOf99 => mean(&|look| at_share(&look.depths_m, 0.99)),
            Deepest => mean(&|look| at_share(&look.depths_m, 1.0)),
            GroundForce => self::mean(run.ground_ratios.iter().copied()),
            Displacement => of_bodies(&|look, body| length(from_start(look, body))),
            Displaced => of_bodies(&|look, body| share(length(from_start(look, body)) > 0.25)),
            Travel => of_bodies(&|look, body| from_start(look, body)[0].abs()),
            Fallen => of_bodies(&|look, body| share(upright(look, body) < 0.5f64.sqrt())),
            Gap => mean(&|look| mean_gap_m(&subject.scene, &subject.scene.joints, look)),
            Asleep => mean(&|look| look.asleep as f64 / look.moving().count() as f64),
        };
        Figure { value, better: self.better(), within: self.floor() }
    }
}

/// What is known of a scene before it runs.
pub(super) struct Subject {
    /// The starts and joints of the bodies.
    pub(super) scene: Scene,
    masses_kg: Vec<f64>,
}

impl Subject {
    pub(super) fn new(scene: Scene) -> Self {
        Self { masses_kg: masses_kg(&scene), scene }
    }
}

/// Returns the mean; 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0u32, 0.0), |(count, sum), value| (count + 1, sum + value));
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}

/// Returns the value at a share of sorted values, by nearest rank; 0 of nothing.
fn at_share(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

fn net_momentum(look: &Look, masses_kg: &[f64]) -> f64 {
    let (mut net, mut all) = ([0.0; 3], 0.0);
    for body in look.moving() {
        let momentum = look.velocity(body).map(|v| masses_kg[body] * v);
        (0..3).for_each(|i| net[i] += momentum[i]);
        all += length(momentum);
    }
    if all > 0.0 { length(net) / all } else { 0.0 }
}

/// Returns the cosine between a body's own y axis and upright.
fn upright(look: &Look, body: usize) -> f64 {
    let [x, _, z, _] = look.bodies[body].map_or([f32::NAN; 4], |(pose, _)| pose.rotation);
    1.0 - 2.0 * (f64::from(x).powi(2) + f64::from(z).powi(2))
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use dcd::protocol::{Velocity, WorldPose};
    use dcd::rapier3d::prelude::Rotation;
    use dcd::scene::Params;

    use super::*;

    fn subject() -> Subject {
        Subject::new(Scene::named("tower", &Params::new().with("n", 2)).unwrap())
    }

    /// Returns a run of a tower of two, the second of which is somewhere else at the end.
    fn run(pose: WorldPose, velocity: [f32; 3]) -> Trace {
        let at = |y: f64| Some((WorldPose::at([0.0, y, 0.0]), Velocity::default()));
        let moved = Some((pose, Velocity { linear: velocity, angular: [0.0; 3] }));
        let start = Look { bodies: vec![None, at(0.5), at(1.5)], energy_j: 20.0, ..Look::default() };
        let depths_m = (1..=100).map(|i| f64::from(i) * 1e-3).collect();
        let bodies = vec![None, at(0.5), moved];
        let end = Look { t_s: 5.0, bodies, energy_j: 10.0, depths_m, asleep: 1, penetration_m: 0.1 };
        Trace { looks: vec![start, end], ..Trace::default() }
    }

    fn value(statistic: Statistic, run: &Trace) -> f64 {
        statistic.figure(run, &subject()).value
    }

    #[test]
    fn figures_are_of_the_last_second() {
        let run = run(WorldPose::at([3.0, 5.5, 4.0]), [0.0, 4.0, 0.0]);
        for (statistic, expected) in [
            (Energy, 0.5),
            (Momentum, 1.0),
            (MeanHeight, 3.0),
            (HighestTenth, 5.5),
            (Motion, 0.5 * 16.0 / 19.62),
            (MeanDepth, 0.0505),
            (DepthOf99, 0.099),
            (Deepest, 0.1),
            (Displacement, 0.5 * 41f64.sqrt()),
            (Displaced, 0.5),
            (Travel, 1.5),
            (Fallen, 0.0),
            (Asleep, 0.5),
        ] {
            assert!(
                (value(statistic, &run) - expected).abs() < 1e-6,
                "{statistic:?}: {}",
                value(statistic, &run)
            );
        }
    }

    #[test]
    fn what_leans_by_more_than_45_degrees_has_fallen() {
        for (degrees, fallen) in [(40f32, 0.0), (50.0, 0.5), (90.0, 0.5), (180.0, 0.5)] {
            let rotation = Rotation::from_rotation_x(degrees.to_radians()).to_array();
            let run = run(WorldPose { rotation, ..WorldPose::default() }, [0.0; 3]);
            assert_eq!(value(Fallen, &run), fallen, "{degrees}");
        }
    }

    #[test]
    fn a_lost_body_is_no_number() {
        let run = run(WorldPose::at([f64::NAN; 3]), [0.0; 3]);
        assert!(value(MeanHeight, &run).is_nan());
    }
}
