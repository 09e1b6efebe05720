//! Decides at which tick each predicted body is shown: own avatars and what they touch ahead of the world,
//! all else a moment behind it. Bodies that change from one to the other do so gradually.

use std::collections::{BTreeMap, BTreeSet};

use super::Near;
use crate::physics::RegionHost;
use crate::playback::{Melt, Motion, ViewTime};
use crate::space::{BodyId, Groups};

/// The gap from which on a body is about to be touched, metres.
const GAP_M: f64 = 0.5;
/// The time within which a gap that closes counts as well, seconds.
const SOON_S: f64 = 0.4;
/// The time in which a moving body changes from one of the two ticks to the other, seconds.
const CHANGE_S: f64 = 1.0;
/// The tick at which a body is shown, and the error that fades out there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    is_own: bool,
    reach_m: f64,
    /// 0 is a moment behind the world, 1 is ahead of it.
    ahead: f64,
    is_engaged: bool,
    tick: Option<f64>,
    melt: Option<Melt>,
}

impl Shown {
    pub(super) fn new(is_own: bool, reach_m: f64) -> Self {
        Self {
            is_own,
            reach_m,
            ahead: f64::from(u8::from(is_own)),
            is_engaged: is_own,
            tick: None,
            melt: None,
        }
    }

    pub(super) fn is_own(&self) -> bool {
        self.is_own
    }

    /// Returns whether the body is an own avatar, touches one, or soon may.
    pub(super) fn is_engaged(&self) -> bool {
        self.is_engaged
    }

    pub(super) fn ahead(&self) -> f64 {
        self.ahead
    }

    /// Returns the tick at which the body was shown last.
    pub(super) fn tick(&self) -> Option<f64> {
        self.tick
    }

    /// Adds what is left of an error that was shown to a motion.
    pub(super) fn melt(&self, motion: &mut Motion, tick: f64, dt_s: f64) {
        if let Some(melt) = &self.melt {
            melt.apply(motion, tick, dt_s);
        }
    }

    /// Goes on from what was shown (`before`), though the body is known to be elsewhere now (`bare`). Returns
    /// how far apart these are, metres.
    pub(super) fn melt_from(&mut self, before: &Motion, bare: &Motion, tick: f64, dt_s: f64) -> f64 {
        self.melt = Melt::after(self.melt.take(), before, bare, tick, dt_s);
        before.distance_m(bare)
    }
}

/// Finds which bodies are engaged with own avatars, and moves the tick at which each body is shown: at once
/// for those that are `still`, gradually for the others.
pub(super) fn advance(
    near: &mut BTreeMap<BodyId, Near>,
    host: &RegionHost,
    still: &BTreeSet<BodyId>,
    dt_s: f64,
    time: &ViewTime,
) {
    let engaged = engaged(near, host);
    for (id, near) in near {
        let shown = &mut near.shown;
        shown.is_engaged = shown.is_own || engaged.contains(id);
        let goal = f64::from(u8::from(shown.is_engaged));
        let tick = |ahead: f64| time.shown + ahead * (time.predicted - time.shown);
        let frame = shown.tick.map_or(1.0, |last| (tick(shown.ahead) - last).clamp(0.0, 4.0));
        let most = if still.contains(id) { 1.0 } else { frame * dt_s / CHANGE_S };
        shown.ahead += (goal - shown.ahead).clamp(-most, most);
        shown.tick = Some(tick(shown.ahead));
    }
}

/// Returns the bodies that own avatars touch, directly or through others, or soon may touch.
fn engaged(near: &BTreeMap<BodyId, Near>, host: &RegionHost) -> BTreeSet<BodyId> {
    let newest = |near: &Near| near.states.back().map(|state| (Motion::of(state), near.shown.reach_m));
    let own: Vec<_> = near.values().filter(|near| near.shown.is_own).filter_map(newest).collect();
    let mut groups = Groups::default();
    for region in host.regions() {
        let physics = region.physics();
        let body_of = |collider| {
            let body = physics.colliders.get(collider)?.parent()?;
            let (id, _) = region.role_of(body)?;
            near.contains_key(&id).then_some(id)
        };
        for pair in physics.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact()) {
            if let (Some(a), Some(b)) = (body_of(pair.collider1), body_of(pair.collider2)) {
                groups.join(a, b);
            }
        }
    }
    let meets = |near: &Near| {
        let Some((motion, reach_m)) = newest(near) else { return false };
        own.iter().any(|(avatar, avatar_reach_m)| {
            let speed =
                (0..3).map(|i| f64::from(motion.velocity.linear[i] - avatar.velocity.linear[i]).powi(2));
            let gap_m = motion.distance_m(avatar) - reach_m - avatar_reach_m;
            gap_m < GAP_M + SOON_S * speed.sum::<f64>().sqrt()
        })
    };
    let met: Vec<_> =
        near.iter().filter(|(_, near)| near.shown.is_own || meets(near)).map(|(id, _)| *id).collect();
    let roots: BTreeSet<_> = met.iter().map(|id| groups.root(*id)).collect();
    near.keys().filter(|id| roots.contains(&groups.root(**id))).copied().collect()
}
