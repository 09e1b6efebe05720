//! Describes an experiment: scenes, where they are cut, and a formula that turns what was seen into one error.

use dcd::scene::Scene;
use dcd::space::Axis;

use super::fleet::Fault;
use super::trace::Trace;
use super::world::World;

/// One row of the suite.
pub(crate) struct Experiment {
    /// Its number in the suite.
    pub number: u8,
    /// As it is asked for.
    pub name: &'static str,
    /// What is measured, as a formula.
    pub metric: &'static str,
    /// Its variants; the worst of them stands for the experiment.
    pub cases: fn(Size) -> Vec<Case>,
    /// Into how many regions it is cut besides those asked for.
    pub more_regions: &'static [usize],
    /// Whether the time error (R2) and the compliance of contacts (R3) of one world add to the picture.
    pub finer: bool,
}

/// How long and how large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// For CI: all experiments together take a few minutes.
    Quick,
    /// As the suite says.
    Full,
}

impl Size {
    /// One of two values.
    pub(crate) fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// A plane through the world: an axis and metres on it.
pub(crate) type Cut = (Axis, f64);

/// The planes that make so many regions.
pub(crate) type Cuts = Box<dyn Fn(usize) -> Vec<Cut> + Send + Sync>;

/// What is done to the world before each step, told the simulated seconds so far.
pub(crate) type Drive = Box<dyn Fn(&mut World, f64) + Send + Sync>;

/// The error of a run, beside one bare world's.
pub(crate) type Formula = Box<dyn Fn(&Trace, &Trace) -> f64 + Send + Sync>;

/// Figures of a run, all in one unit.
pub(crate) type Figures = Box<dyn Fn(&Trace) -> Vec<Figure> + Send + Sync>;

/// One figure of a chaotic run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Figure {
    /// What it is.
    pub value: f64,
    /// On which side of one world's mean a run may be as well.
    pub better: Better,
    /// An error up to this always passes.
    pub within: f64,
}

/// Where a figure is better than that of one world, so that being there is no error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Better {
    /// Nowhere.
    Nowhere,
    /// Below it, as of penetration.
    Less,
    /// Between it and what is right.
    Towards(f64),
}

/// How runs become an error.
pub(crate) enum Measure {
    /// The worst of a case's runs counts.
    Formula(Formula),
    /// For what is chaotic. The error is how far the mean of a figure over all seeds is from that of one bare world and its
    /// twins (one body of which starts 1 µm aside); the error of one world is the standard deviation of its own runs and
    /// their twins. Of several figures the one counts that is worst by what is allowed.
    Statistics(Figures),
}

/// A variant of an experiment.
pub(crate) struct Case {
    /// Tells it from the other variants.
    pub label: String,
    /// What is run. Several scenes are several seeds of the same, measured together.
    pub scenes: Vec<Scene>,
    /// What one bare world is run with for the reference, where that is another scene.
    pub reference_scenes: Option<Vec<Scene>>,
    /// Positions are compared before chaos grows: what one world has for an error is that of a twin, one body of which
    /// starts 1 µm aside. Regions exchange once a tick then, since a ball that bounces in a substep is elsewhere than
    /// one that bounces in a whole step.
    pub early: bool,
    /// Simulated seconds.
    pub seconds: f64,
    /// Simulated seconds from one look at the bodies to the next; 0 looks after every step.
    pub look_s: f64,
    /// Where the border hurts, for each number of regions.
    pub cuts: Cuts,
    /// What acts on the world from outside.
    pub drive: Option<Drive>,
    /// The error.
    pub measure: Measure,
    /// Unit of the error; empty for plain numbers.
    pub unit: &'static str,
    /// An error up to this always passes, in the unit of the error.
    pub threshold: Option<f64>,
    /// How often the error of one world is allowed.
    pub slack: f64,
    /// What rounding alone may add to the error of one world, in the unit of the error.
    pub floor: f64,
    /// Nothing acts from outside, so momentum must stay.
    pub free: bool,
    /// In the last second everything rests on fixed ground, so that must carry the weight.
    pub rests: bool,
    /// How many pairs of colliders must touch at the end.
    pub pairs: Option<usize>,
    /// What is wrong with exchanges.
    pub fault: Option<Fault>,
}

impl Better {
    /// How far a mean is off that of one world, where that is an error.
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
    /// A case of one scene with the usual floor of 0.1 mm.
    pub(crate) fn new(
        label: impl Into<String>,
        scene: Scene,
        seconds: f64,
        cuts: impl Fn(usize) -> Vec<Cut> + Send + Sync + 'static,
        measure: impl Fn(&Trace, &Trace) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::of(label, vec![scene], seconds, cuts, Measure::Formula(Box::new(measure)))
    }

    /// A case of several scenes.
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

    /// Another formula.
    pub(crate) fn measured_by(
        mut self,
        measure: impl Fn(&Trace, &Trace) -> f64 + Send + Sync + 'static,
    ) -> Self {
        self.measure = Measure::Formula(Box::new(measure));
        self
    }

    /// Measured, but nothing is asked of the error.
    pub(crate) fn charted(mut self) -> Self {
        (self.threshold, self.rests) = (Some(f64::INFINITY), false);
        self
    }

    /// The error's unit and floor, where it is no length.
    pub(crate) fn in_unit(mut self, unit: &'static str, floor: f64) -> Self {
        (self.unit, self.floor) = (unit, floor);
        self
    }

    /// An error up to this always passes.
    pub(crate) fn within(mut self, threshold: f64) -> Self {
        self.threshold = Some(threshold);
        self
    }

    /// Something acts on the world before each step; it is told the simulated seconds so far.
    pub(crate) fn driven(mut self, drive: impl Fn(&mut World, f64) + Send + Sync + 'static) -> Self {
        self.drive = Some(Box::new(drive));
        self
    }

    /// Looks at the bodies after every step.
    pub(crate) fn every_step(mut self) -> Self {
        self.look_s = 0.0;
        self
    }

    /// Everything rests on fixed ground at the end.
    pub(crate) fn resting(mut self) -> Self {
        self.rests = true;
        self
    }

    /// Nothing acts from outside.
    pub(crate) fn free(mut self) -> Self {
        self.free = true;
        self
    }
}

/// The first planes of a list that give so many regions: for parallel planes, each of which adds one.
pub(crate) fn planes(axis: Axis, planes: impl Into<Vec<f64>>) -> impl Fn(usize) -> Vec<Cut> {
    let planes = planes.into();
    move |regions| planes[..regions - 1].iter().map(|&at| (axis, at)).collect()
}

/// Three planes across each other through one point: 2, 4 or 8 regions meet there.
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
