//! Describes an experiment: scenes, the planes that cut them, and a formula that turns what was observed into
//! one error.

use dcd::scene::Scene;
use dcd::space::Axis;

use super::fleet::Fault;
use super::trace::Trace;
use super::world::World;

/// An experiment, one row of the suite.
pub(crate) struct Experiment {
    /// Its number in the suite.
    pub number: u8,
    /// The name by which it is asked for.
    pub name: &'static str,
    /// The metric, as a formula.
    pub metric: &'static str,
    /// Its variants; the worst of them stands for the experiment.
    pub cases: fn(Size) -> Vec<Case>,
    /// Numbers of regions that it is cut into besides those asked for.
    pub more_regions: &'static [usize],
    /// Says whether two finer bare worlds add to the picture: R2 shows the time error of one world, R3 the
    /// compliance of its contacts.
    pub finer: bool,
}

/// The length and size of the experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// For CI: all experiments together take a few minutes.
    Quick,
    /// As the suite defines it.
    Full,
}

impl Size {
    /// Returns one of two values, by size.
    pub(crate) fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// A plane through the world: an axis and metres on it.
pub(crate) type Cut = (Axis, f64);

/// The planes that make a given number of regions.
pub(crate) type Cuts = Box<dyn Fn(usize) -> Vec<Cut> + Send + Sync>;

/// A function that acts on the world before each step, given the simulated seconds so far.
pub(crate) type Drive = Box<dyn Fn(&mut World, f64) + Send + Sync>;

/// The error of a run, given the run and that of one bare world.
pub(crate) type Formula = Box<dyn Fn(&Trace, &Trace) -> f64 + Send + Sync>;

/// Figures of a run, all in one unit.
pub(crate) type Figures = Box<dyn Fn(&Trace) -> Vec<Figure> + Send + Sync>;

/// One figure of a chaotic run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Figure {
    /// The value of the figure.
    pub value: f64,
    /// The side of one world's mean on which a run is no worse.
    pub better: Better,
    /// The largest error that always passes.
    pub within: f64,
}

/// The range in which a figure is better than that of one world, so that its distance is no error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Better {
    /// Nowhere.
    Nowhere,
    /// Below one world's figure, as for penetration.
    Less,
    /// Between one world's figure and the right one.
    Towards(f64),
}

/// The rule that reduces runs to an error.
pub(crate) enum Measure {
    /// A formula; the worst of a case's runs counts.
    Formula(Formula),
    /// Figures, for chaotic scenes. The error is the distance of a figure's mean over all seeds from that of
    /// one bare world and its twins, in which one body starts 1 µm aside. The error of one world is the
    /// standard deviation of its own runs and their twins. Of several figures, the one counts that is worst
    /// in relation to what is allowed.
    Statistics(Figures),
}

/// A variant of an experiment.
pub(crate) struct Case {
    /// The label that tells it from the other variants.
    pub label: String,
    /// The scenes that are run. Several scenes are several seeds of the same, measured together.
    pub scenes: Vec<Scene>,
    /// The scenes that one bare world is run with for the reference, where they are others.
    pub reference_scenes: Option<Vec<Scene>>,
    /// Says whether positions are compared before chaos grows. The error of one world is then the mean of those
    /// of three others, in which the bodies are inserted in other orders: the solver takes contacts in that
    /// order, and stops before it matters no more. Regions exchange once per tick, since a ball that bounces in
    /// a substep is elsewhere than one that bounces in a whole step.
    pub early: bool,
    /// The simulated seconds of a run.
    pub seconds: f64,
    /// The simulated seconds from one look at the bodies to the next; 0 looks after every step.
    pub look_s: f64,
    /// The planes that put borders where they hurt, for each number of regions.
    pub cuts: Cuts,
    /// What acts on the world from outside.
    pub drive: Option<Drive>,
    /// The rule that reduces runs to an error.
    pub measure: Measure,
    /// Unit of the error; empty for plain numbers.
    pub unit: &'static str,
    /// The largest error that always passes, in the unit of the error.
    pub threshold: Option<f64>,
    /// The factor on the error of one world that is allowed.
    pub slack: f64,
    /// What rounding alone may add to the error of one world, in the unit of the error.
    pub floor: f64,
    /// Says whether nothing acts from outside, so that momentum must stay.
    pub free: bool,
    /// Says whether everything rests on fixed ground in the last second, so that the ground must carry the weight.
    pub rests: bool,
    /// The number of pairs of colliders that must touch at the end.
    pub pairs: Option<usize>,
    /// The fault of the exchanges.
    pub fault: Option<Fault>,
}

impl Better {
    /// Returns how far a mean is off that of one world, where that is an error.
    pub(crate) fn error(self, mean: f64, one_world: f64) -> f64 {
        let off = mean - one_world;
        match self {
            Self::Less if off < 0.0 => 0.0,
            Self::Towards(right) if off * (right - one_world) > 0.0 => {
                (off.abs() - (right - one_world).abs()).max(0.0)
            }
            _ => off.abs(),
        }
    }
}

impl Case {
    /// Makes a case of one scene with the usual floor of 0.1 mm.
    pub(crate) fn new(
        label: impl Into<String>,
        scene: Scene,
        seconds: f64,
        cuts: impl Fn(usize) -> Vec<Cut> + Send + Sync + 'static,
        measure: impl Fn(&Trace, &Trace) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::of(label, vec![scene], seconds, cuts, Measure::Formula(Box::new(measure)))
    }

    /// Makes a case of several scenes.
    pub(crate) fn of(
        label: impl Into<String>,
        scenes: Vec<Scene>,
        seconds: f64,
        cuts: impl Fn(usize) -> Vec<Cut> + Send + Sync + 'static,
        measure: Measure,
    ) -> Self {
        Self {
            label: label.into(),
            scenes,
            reference_scenes: None,
            early: false,
            slack: 1.1,
            seconds,
            look_s: 0.1,
            cuts: Box::new(cuts),
            drive: None,
            measure,
            unit: "m",
            threshold: None,
            floor: 1e-4,
            free: false,
            rests: false,
            pairs: None,
            fault: None,
        }
    }

    /// Sets another formula.
    pub(crate) fn measured_by(
        mut self,
        measure: impl Fn(&Trace, &Trace) -> f64 + Send + Sync + 'static,
    ) -> Self {
        self.measure = Measure::Formula(Box::new(measure));
        self
    }

    /// Measures the error, but asks nothing of it.
    pub(crate) fn charted(mut self) -> Self {
        (self.threshold, self.rests) = (Some(f64::INFINITY), false);
        self
    }

    /// Sets the unit and the floor of an error that is no length.
    pub(crate) fn in_unit(mut self, unit: &'static str, floor: f64) -> Self {
        (self.unit, self.floor) = (unit, floor);
        self
    }

    /// Lets an error up to this always pass.
    pub(crate) fn within(mut self, threshold: f64) -> Self {
        self.threshold = Some(threshold);
        self
    }

    /// Lets something act on the world before each step; it is told the simulated seconds so far.
    pub(crate) fn driven(mut self, drive: impl Fn(&mut World, f64) + Send + Sync + 'static) -> Self {
        self.drive = Some(Box::new(drive));
        self
    }

    /// Looks at the bodies after every step.
    pub(crate) fn every_step(mut self) -> Self {
        self.look_s = 0.0;
        self
    }

    /// States that everything rests on fixed ground at the end.
    pub(crate) fn resting(mut self) -> Self {
        self.rests = true;
        self
    }

    /// States that nothing acts from outside.
    pub(crate) fn free(mut self) -> Self {
        self.free = true;
        self
    }
}

/// Returns the first planes of a list, as many as give so many regions: for parallel planes, each of which
/// adds one.
pub(crate) fn planes(axis: Axis, planes: impl Into<Vec<f64>>) -> impl Fn(usize) -> Vec<Cut> {
    let planes = planes.into();
    move |regions| planes[..regions - 1].iter().map(|&at| (axis, at)).collect()
}

/// Returns up to three planes across each other through one point, where 2, 4 or 8 regions meet.
pub(crate) fn corner(axes: [Axis; 3], point: [f64; 3]) -> impl Fn(usize) -> Vec<Cut> {
    move |regions| {
        let count = regions.ilog2() as usize;
        assert!(regions == 1 << count && count <= 3, "a corner has 1, 2, 4 or 8 regions, not {regions}");
        axes[..count].iter().map(|&axis| (axis, point[axis.index()])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_may_be_better_than_that_of_one_world() {
        assert_eq!(Better::Nowhere.error(0.5, 0.75), 0.25);
        assert_eq!(Better::Less.error(0.5, 0.75), 0.0);
        assert_eq!(Better::Less.error(1.0, 0.75), 0.25);
        let energy = Better::Towards(1.0);
        assert_eq!(energy.error(0.5, 0.75), 0.25);
        assert_eq!(energy.error(0.9, 0.75), 0.0);
        assert_eq!(energy.error(1.25, 0.75), 0.25);
        assert!(energy.error(f64::NAN, 0.75).is_nan());
    }
}
