//! Takes in what owners tell some ticks late (`owner` without lockstep). States are carried forward to the present tick
//! (dead reckoning, thesis 3.3.11), unless that contradicts what the copies here have met:
//!
//! - A copy that was just hit goes on as it does here, until its owner tells states from after the hit. The owner has
//!   computed the same hit by now. An earlier state would put the copy back to where it was about to be hit, and it
//!   would be hit again in each of the ticks until then: what does not bounce bounced fully.
//! - A copy that touches something is carried forward by how it has moved of late in the mean. What lies still is told
//!   with velocities that tremble. Carried forward over many ticks, they shake a stack until it falls.
//! - What joints hold goes on as it does here, unless it was some centimetres from where its owner had it in the same tick.
//!   Then all that hangs together is computed again from there, tick by tick (`replay`): to be carried forward body by body
//!   would strain its joints. What is handed over is so, too, and a multibody, which no two regions share, always.
//! - What touches nothing falls on the way.

mod multibodies;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use rapier3d::prelude::{RigidBody, RigidBodyHandle, Vector};
use serde::{Deserialize, Serialize};

use self::multibodies::carry_multibodies_forward;
use super::replay::replay;
use crate::physics::hits::Hits;
use crate::physics::region::{Ownership, Region};
use crate::protocol::{BorderMessage, MAX_LAG, Velocity, WorldPose};
use crate::space::{BodyId, Tick};

/// The difference between a velocity and the mean of those before, m/s, up to which a copy that touches something is
/// carried forward by the mean.
const STEADY_M_S: f32 = 1.0;
/// Over how many times as long as states come late the mean of velocities reaches.
const MEAN_OVER: f32 = 2.0;
/// The distance, metres, of a copy that joints hold from where its owner had it in the same tick, from which on it is
/// computed again.
const APART_M: f64 = 0.05;
/// The same for its velocity, m/s, where it is handed over.
const APART_M_S: f32 = 0.5;

/// The courses of copies whose owners' states come late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Late {
    /// By how many ticks states come late at most; 0 where none ever did.
    most: u64,
    courses: BTreeMap<BodyId, Course>,
    /// The copies that joints hold.
    tied: BTreeMap<BodyId, Past>,
}

/// Where a copy that joints hold was after each of the last ticks.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Past {
    /// Says whether the copy began where its owner had it, and not where it was reckoned to be.
    is_sure: bool,
    /// Its states, newest last.
    states: VecDeque<(Tick, WorldPose, Velocity)>,
}

/// The state that a copy that joints hold is to have now.
struct Tied {
    pose: WorldPose,
    velocity: Velocity,
    /// Says whether that comes from what its owner told.
    is_replayed: bool,
}

/// The motion of a copy of late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Course {
    hits: Hits,
    /// The mean of the velocities told of late, linear and angular.
    mean: Option<(Vector, Vector)>,
}

impl Late {
    /// Carries what a message says of bodies forward from its tick to the present one, `now`. Returns the bodies that are
    /// handed over as they are here, each with the tick since which it has gone on so. Those in `as_told` are not.
    pub(super) fn carry_forward(
        &mut self,
        region: &Region,
        message: &mut BorderMessage,
        now: Tick,
        dt_s: f32,
        as_told: &BTreeSet<BodyId>,
    ) -> BTreeMap<BodyId, Tick> {
        let told = message.tick;
        let late = now.0.saturating_sub(told.0);
        let late_s = late as f64 * f64::from(dt_s);
        self.most = self.most.max(late.min(u64::from(MAX_LAG)));
        let mut tied = self.carry_tied_forward(region, message, now, dt_s, as_told);
        tied.extend(carry_multibodies_forward(region, message, late.min(u64::from(MAX_LAG)), dt_s));
        let mut as_here = BTreeMap::new();
        let (courses, gravity) = (&mut self.courses, region.physics().gravity);
        message.carry_forward(|id, pose, velocity| {
            if let Some(here) = tied.get(&id) {
                (*pose, *velocity) = (here.pose, here.velocity);
                if !here.is_replayed {
                    as_here.insert(id, told);
                }
                return;
            }
            let Some(handle) = copy_of(region, id).filter(|handle| !region.is_jointed(*handle)) else {
                *pose = pose.moved(velocity, late_s);
                return;
            };
            let course = courses.entry(id).or_default();
            let mean = course.take_in(velocity, late);
            let alone = course.hits.alone_since(told, late).filter(|_| !as_told.contains(&id));
            if let Some(since) = alone {
                let state = region.body_state(handle);
                (*pose, *velocity) = (state.pose, state.velocity);
                as_here.insert(id, since);
            } else if region.is_pressed(handle) {
                // What speeds up steadily is ahead of the mean.
                let is_steady = differ_m_s(&mean, velocity) < STEADY_M_S;
                *pose = pose.moved(if is_steady { &mean } else { velocity }, late_s);
            } else {
                // Velocities change before bodies are moved by them.
                let falls = gravity * falls_by(&region.physics().bodies[handle]);
                let on_the_way = add(velocity, falls * (0.5 * (late + 1) as f32 * dt_s));
                *pose = pose.moved(&on_the_way, late_s);
                *velocity = add(velocity, falls * late_s as f32);
            }
        });
        let handed_over = message.transfers.iter().map(|transfer| transfer.body.id);
        handed_over.filter_map(|id| Some((id, *as_here.get(&id)?))).collect()
    }

    /// Compares copies that joints hold with what a message tells of the same tick. Returns how they are to be now: as they
    /// are or, where any body of their assembly was too far off, as its bodies come from where they were told to be.
    fn carry_tied_forward(
        &mut self,
        region: &Region,
        message: &mut BorderMessage,
        now: Tick,
        dt_s: f32,
        as_told: &BTreeSet<BodyId>,
    ) -> BTreeMap<BodyId, Tied> {
        let (told, tied) = (message.tick, &mut self.tied);
        let late = now.0.saturating_sub(told.0).min(u64::from(MAX_LAG));
        let handed_over: BTreeSet<_> = message.transfers.iter().map(|transfer| transfer.body.id).collect();
        let (mut told_of, mut off) = (BTreeMap::new(), BTreeSet::new());
        message.carry_forward(|id, pose, velocity| {
            let Some(handle) = copy_of(region, id).filter(|&handle| is_tied(region, handle)) else { return };
            let slot = region.slot(handle);
            let is_as_told = tied.get(&id).is_some_and(|past| match past.at(told) {
                // What is handed over is not told of again.
                Some((_, was, speed)) if handed_over.contains(&id) => {
                    differ_m(was, pose, slot.reach_m) < APART_M && differ_m_s(speed, velocity) < APART_M_S
                }
                Some((_, was, _)) => differ_m(was, pose, slot.reach_m) < APART_M,
                None => past.is_sure && !handed_over.contains(&id),
            });
            if !is_as_told || as_told.contains(&id) {
                off.extend(slot.assembly);
            }
            told_of.insert(id, (handle, slot.assembly, *pose, *velocity));
        });
        let is_off = |assembly: Option<u32>| assembly.is_some_and(|assembly| off.contains(&assembly));
        let start = told_of.values().filter(|(_, assembly, ..)| is_off(*assembly));
        let start: Vec<_> = start.map(|&(handle, _, pose, velocity)| (handle, pose, velocity)).collect();
        let mut replayed = replay(region, &start, late, dt_s).into_iter();
        let mut carried = BTreeMap::new();
        for (id, (_, assembly, ..)) in told_of {
            let past = tied.entry(id).or_default();
            let is_replayed = is_off(assembly);
            if is_replayed {
                let (pose, velocity) = replayed.next().expect("one for each");
                *past = Past { is_sure: true, states: [(now, pose, velocity)].into() };
            }
            if let Some(&(_, pose, velocity)) = past.states.back() {
                carried.insert(id, Tied { pose, velocity, is_replayed });
            }
        }
        carried
    }

    /// Notes which copies were hit in the step of a tick.
    pub(super) fn look_back(&mut self, region: &Region, tick: Tick, dt_s: f32) {
        for (id, course) in &mut self.courses {
            if let Some(handle) = copy_of(region, *id) {
                course.hits.look_back(region, handle, tick, self.most, dt_s);
            }
        }
        if self.most == 0 {
            return;
        }
        let is_here = |handle| is_tied(region, handle) && region.physics().bodies[handle].is_dynamic();
        self.tied.retain(|&id, _| copy_of(region, id).is_some_and(is_here));
        for link in region.ghosts().iter().filter(|link| is_here(link.handle)) {
            let state = region.body_state(link.handle);
            let states = &mut self.tied.entry(link.id).or_default().states;
            // A tick may have several substeps.
            states.retain(|(of, ..)| *of != tick && of.0 + self.most >= tick.0);
            states.push_back((tick, state.pose, state.velocity));
        }
    }

    /// Notes how copies move after an exchange.
    pub(super) fn look_ahead(&mut self, region: &Region) {
        self.courses.retain(|id, course| {
            let body = copy_of(region, *id).map(|handle| &region.physics().bodies[handle]);
            body.inspect(|body| course.hits.look_ahead(body)).is_some()
        });
    }
}

impl Course {
    /// Takes in a velocity told by the owner. Returns the mean.
    fn take_in(&mut self, told: &Velocity, late: u64) -> Velocity {
        let share = 1.0 / (1.0 + MEAN_OVER * late as f32);
        let told = (Vector::from(told.linear), Vector::from(told.angular));
        let (linear, angular) = self.mean.get_or_insert(told);
        *linear += (told.0 - *linear) * share;
        *angular += (told.1 - *angular) * share;
        Velocity { linear: (*linear).into(), angular: (*angular).into() }
    }
}

impl Past {
    /// Returns what is known of a tick.
    fn at(&self, tick: Tick) -> Option<&(Tick, WorldPose, Velocity)> {
        self.states.iter().find(|(of, ..)| *of == tick)
    }
}

/// Returns the share of gravity by which a body falls along each axis: none without mass, or where it is locked.
fn falls_by(body: &RigidBody) -> Vector {
    body.mass_properties().effective_inv_mass * body.mass() * body.gravity_scale()
}

/// Returns how far the points of a body that reaches so far are apart at most in two poses, metres.
fn differ_m(a: &WorldPose, b: &WorldPose, reach_m: f32) -> f64 {
    let (a, b) = (a.isometry(), b.isometry());
    (a.translation.vector - b.translation.vector).norm()
        + f64::from(reach_m) * a.rotation.angle_to(&b.rotation)
}

fn differ_m_s(a: &Velocity, b: &Velocity) -> f32 {
    (Vector::from(a.linear) - Vector::from(b.linear)).length()
}

fn add(velocity: &Velocity, change: Vector) -> Velocity {
    Velocity { linear: (Vector::from(velocity.linear) + change).into(), ..*velocity }
}

/// Returns whether a body is held by impulse joints and by nothing that Rapier knows nothing of.
fn is_tied(region: &Region, handle: RigidBodyHandle) -> bool {
    region.is_jointed(handle) && region.is_auditable(handle)
}

/// Returns the copy of a dynamic body that another region owns.
fn copy_of(region: &Region, id: BodyId) -> Option<RigidBodyHandle> {
    let is_dynamic = |handle: &RigidBodyHandle| region.physics().bodies[*handle].is_dynamic();
    ghost_of(region, id).filter(is_dynamic)
}

/// Returns the copy of a body that another region owns.
fn ghost_of(region: &Region, id: BodyId) -> Option<RigidBodyHandle> {
    let handle = region.handle_of(id)?;
    matches!(region.slot(handle).role, Ownership::Ghost { .. }).then_some(handle)
}

#[cfg(test)]
mod tests;
