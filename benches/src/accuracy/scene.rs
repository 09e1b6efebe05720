//! What an experiment is: scenes, where they are cut, and a formula that turns what was seen into one error.

use dcd::runtime::measure::Subject;
use dcd::scene::Scene;
use dcd::space::Axis;

use super::trace::Trace;

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
pub(crate) type Drive = Box<dyn Fn(&mut Subject, f64) + Send + Sync>;

/// The error of a run, beside one bare world's.
pub(crate) type Formula = Box<dyn Fn(&Trace, &Trace) -> f64 + Send + Sync>;

/// Figures of a run, all in one unit.
pub(crate) type Figures = Box<dyn Fn(&Trace) -> Vec<f64> + Send + Sync>;

/// How runs become an error.
pub(crate) enum Measure {
    /// The worst of a case's runs counts.
    Formula(Formula),
    /// For what is chaotic. The error is how far the mean of a figure over
    /// all seeds is from that of one bare world and its twins (one body of which starts 1 µm aside); the error of one world
    /// is the standard deviation of its own runs and their twins. Of several figures the one counts that is worst by this.
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
    /// Whether a formula's error of one world is that of a twin, one body of which starts 1 µm aside.
    pub twin: bool,
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
    /// What rounding alone may add to the error of one world, in the unit of the error.
    pub floor: f64,
    /// Nothing acts from outside, so momentum must stay.
    pub free: bool,
    /// In the last second everything rests on fixed ground, so that must carry the weight.
    pub rests: bool,
    /// How many pairs of colliders must touch at the end.
    pub pairs: Option<usize>,
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
            twin: false,
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
        }
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
    pub(crate) fn driven(mut self, drive: impl Fn(&mut Subject, f64) + Send + Sync + 'static) -> Self {
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
