//! Measures how far bodies that a client shows are from the truth, which a second link without a limit tells.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::playback::Motion;
use crate::protocol::BodyKind;
use crate::runtime::ClientWorld;
use crate::space::BodyId;

/// The states of a body that are kept for comparison: two seconds, told twenty times per second.
const KEPT: usize = 40;

/// The longest time between two states that is interpolated, ticks.
const GAP: f64 = 6.0;

/// The time after its last state for which a body counts as moving, or as just come to rest, ticks.
const MOMENT: f64 = 60.0;

/// The time after which no state of an earlier tick comes any more, ticks.
const LATEST: f64 = 120.0;

/// The most errors that are kept.
const ERRORS: usize = 4 << 20;

/// The states that the second link told, and what the client showed until the truth of that tick is known.
pub(super) struct Truth {
    world: ClientWorld,
    told: BTreeMap<BodyId, VecDeque<(f64, Motion)>>,
    shown: VecDeque<(f64, Vec<(BodyId, Motion)>)>,
    errors_mm: Vec<f32>,
}

impl Truth {
    /// Creates it with the link that tells the truth.
    pub(super) fn of(world: ClientWorld) -> Self {
        Self { world, told: BTreeMap::new(), shown: VecDeque::new(), errors_mm: Vec::new() }
    }

    /// Notes what a client shows now of bodies that move, and compares what it showed [`LATEST`] ticks ago.
    pub(super) fn look(&mut self, client: &mut ClientWorld, dt_s: f64) {
        let truth = states(&mut self.world);
        for &(id, tick, motion) in &truth {
            let told = self.told.entry(id).or_default();
            if told.back().is_none_or(|&(last, _)| last < tick) {
                told.push_back((tick, motion));
                if told.len() > KEPT {
                    told.pop_front();
                }
            }
        }
        let Some(time) = client.view_time() else { return };
        // Bodies that move in truth, or are shown moving. The client is told of none outside its interest.
        let moving: BTreeSet<_> = states(client).into_iter().chain(truth).map(|(id, ..)| id).collect();
        let heard: BTreeSet<_> =
            client.with_bodies(|view| (!view.outside).then_some(view.body.id)).into_iter().collect();
        let heard = moving.intersection(&heard);
        let shown = heard.filter_map(|&id| Some((id, client.motion_at(id, time.shown)?))).collect();
        self.shown.push_back((time.shown, shown));
        while self.shown.front().is_some_and(|(tick, _)| *tick + LATEST < time.now) {
            let Some((tick, bodies)) = self.shown.pop_front() else { break };
            for (id, shown) in bodies {
                let error = self.at(id, tick, dt_s).map(|is| 1e3 * is.distance_m(&shown));
                if self.errors_mm.len() < ERRORS {
                    self.errors_mm.extend(error.map(|mm| mm as f32));
                }
            }
        }
    }

    /// Returns the true motion of a body at a tick, if states close to it are known.
    fn at(&self, id: BodyId, tick: f64, dt_s: f64) -> Option<Motion> {
        let told = self.told.get(&id)?;
        let after = told.partition_point(|&(of, _)| of <= tick);
        let (from, a) = told.get(after.checked_sub(1)?)?;
        let Some((to, b)) = told.get(after) else {
            // Nothing more was told of it: it rests.
            return Some(*a);
        };
        let span = to - from;
        (span <= GAP).then(|| a.towards(b, span * dt_s, (tick - from) / span))
    }

    /// Returns the errors so far, in order, millimetres.
    pub(super) fn errors_mm(&self) -> Vec<f32> {
        let mut errors = self.errors_mm.clone();
        errors.sort_unstable_by(f32::total_cmp);
        errors
    }

    /// Leaves the server.
    pub(super) fn leave(self) {
        let _ = self.world.leave();
    }
}

/// Returns the newest states of bodies that moved a moment ago, with their ticks.
fn states(world: &mut ClientWorld) -> Vec<(BodyId, f64, Motion)> {
    let now = world.view_time().map_or(0.0, |time| time.now);
    world.with_bodies(|view| {
        let (body, tick) = (&view.body, view.tick.0 as f64);
        let moves = !view.outside && body.traits.kind == BodyKind::Dynamic && tick + MOMENT > now;
        moves.then(|| (body.id, tick, Motion::of(&body.state)))
    })
}
