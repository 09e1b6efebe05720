//! Watches what the bodies of a trial do: whether they stand, hold together, overlap no more than before, and
//! get no energy or momentum from nowhere. Gates bound these quantities; they come from an undisturbed world.

mod course;
mod ruler;

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Mechanics, Sample, Violation};
use crate::protocol::{BodyState, ViewNumber};
use crate::space::{BodyId, GroupId, Tick};

pub use course::Course;
pub use ruler::{Quantity, Ruler, Strain};

/// The bodies of a world after a tick.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// The state of each body.
    pub bodies: BTreeMap<BodyId, BodyState>,
    /// The energy and contacts of all bodies together.
    pub mechanics: Mechanics,
}

/// A collector that combines the samples of a group's members into looks, and compares these with the gates.
#[derive(Clone, Debug)]
pub struct Watch {
    ruler: Ruler,
    gates: Strain,
    groups: BTreeMap<GroupId, Watched>,
    is_calm: bool,
    /// Says whether there have ever been several groups at a time. Groups correct one another's bodies, whose
    /// velocities then change.
    is_corrected: bool,
    /// The worst of each quantity so far, as a share of its gate.
    worst: Strain,
}

/// The time without a tick after which a group is gone.
const GONE: Duration = Duration::from_secs(2);

/// What is known of a group: its newest view, when it last completed a tick, and the course of its bodies.
#[derive(Clone, Debug, Default)]
struct Watched {
    view: ViewNumber,
    heard: Duration,
    /// The ticks that some members have not completed yet, each with the number of members that have.
    open: BTreeMap<Tick, (usize, Look)>,
    course: Course,
}

impl Watch {
    /// Creates a watch with a ruler, and the largest allowed value of each quantity.
    pub fn new(ruler: Ruler, gates: Strain) -> Self {
        Self {
            ruler,
            gates,
            groups: BTreeMap::new(),
            is_calm: false,
            is_corrected: false,
            worst: Strain::default(),
        }
    }

    /// Sets whether all is well. Only then must bodies be where they belong. What moves them is checked at
    /// all times.
    pub(super) fn set_calm(&mut self, is_calm: bool) {
        self.is_calm = is_calm;
    }

    /// Returns the worst of each quantity, as a share of its gate.
    pub(super) fn worst(&self) -> Strain {
        self.worst
    }

    /// Takes in what a node holds after a tick. Checks the world when this is the last member of the group to
    /// complete the tick.
    pub(super) fn settled(&mut self, sample: Sample) -> Result<(), Violation> {
        let (view, tick, members, group) = (sample.view, sample.tick, sample.members, sample.group);
        // Each of several groups computes the world by itself, and corrects its bodies by what it hears of
        // the others' bodies.
        let is_one =
            self.groups.iter().all(|(&other, watched)| other == group || watched.heard + GONE < sample.time);
        self.is_corrected |= !is_one;
        let watched = self.groups.entry(sample.group).or_default();
        if view < watched.view {
            return Ok(());
        }
        if view > watched.view {
            // A recovered state may be older than the others.
            watched.course.interrupt();
            watched.open.clear();
            watched.view = view;
        }
        watched.heard = sample.time;
        let (settled, look) = watched.open.entry(tick).or_default();
        *settled += 1;
        look.bodies.extend(sample.owned.into_iter().filter(|(id, _)| id.client().is_none()));
        look.mechanics = look.mechanics.and(sample.mechanics);
        if *settled < members {
            return Ok(());
        }
        let (_, look) = watched.open.remove(&tick).unwrap_or_default();
        watched.open.retain(|&other, _| other > tick);
        // Where members are out of step, some bodies are on their way from one to another.
        if !self.ruler.is_whole(&look) {
            watched.course.interrupt();
            return Ok(());
        }
        let place = if self.is_calm { self.ruler.of_place(&look) } else { Strain::default() };
        if !is_one {
            watched.course.interrupt();
        }
        let speed = if self.is_corrected { Strain::default() } else { self.ruler.of_speed(&look) };
        let motion = watched.course.follow(&self.ruler, tick, look);
        self.check(tick, place.or_worse(speed).or_worse(motion))
    }

    fn check(&mut self, tick: Tick, found: Strain) -> Result<(), Violation> {
        let shares = found.shares_of(&self.gates);
        self.worst = self.worst.or_worse(shares);
        // A value that is no number is beyond its gate.
        let is_beyond = |quantity: &Quantity| shares.of(*quantity).is_nan() || shares.of(*quantity) > 1.0;
        match Quantity::ALL.into_iter().find(is_beyond) {
            Some(quantity) => {
                let (found, gate) = (quantity.told(&found), quantity.told(&self.gates));
                let what = quantity.summary();
                Err(Violation::Strained { tick, what: format!("{what}: {found}, where {gate} is the most") })
            }
            None => Ok(()),
        }
    }
}
