//! Notes what contact hooks answer, and answers the same in their place: a program's own code cannot be
//! repeated, but its answers can.
//!
//! Only answers that differ from those without hooks are noted. Regions ask from several threads, in any
//! order, but each region asks about one pair in the same order in every run. So a question is identified by
//! region, pair and how often it was asked before in the tick.

use std::collections::BTreeMap;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};

use rapier3d::geometry::SolverContacts;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::collider_id::ColliderId;
use super::hooks::{ContactHooks, HookedPair};
use crate::protocol::{HookAnswer, HookCall, HookQuestion, read_state, write_state};

/// Contact hooks that ask a program's hooks and note their answers.
pub(crate) struct NotedHooks {
    hooks: Arc<dyn ContactHooks>,
    notes: Mutex<Notes>,
}

#[derive(Default)]
struct Notes {
    asked: Asked,
    answers: Vec<(HookCall, HookAnswer)>,
}

/// Contact hooks that answer as others did in a recorded tick.
pub(crate) struct RepeatedHooks {
    answers: BTreeMap<HookCall, HookAnswer>,
    asked: Mutex<Asked>,
}

/// How often each question was asked.
#[derive(Default)]
struct Asked(BTreeMap<HookCall, u32>);

impl Asked {
    fn again(&mut self, question: HookQuestion, pair: &HookedPair<'_>) -> HookCall {
        let name = |collider: ColliderId| (collider.body, collider.index as u16);
        let (first, second) = (name(pair.first), name(pair.second));
        let call = HookCall { region: pair.region, question, first, second, time: 0 };
        let times = self.0.entry(call).or_default();
        *times += 1;
        HookCall { time: *times - 1, ..call }
    }
}

impl NotedHooks {
    pub(crate) fn new(hooks: Arc<dyn ContactHooks>) -> Self {
        Self { hooks, notes: Mutex::default() }
    }

    /// Returns the program's hooks.
    pub(crate) fn program(&self) -> &Arc<dyn ContactHooks> {
        &self.hooks
    }

    /// Takes the answers noted since the last call, in order.
    pub(crate) fn take(&self) -> Vec<(HookCall, HookAnswer)> {
        let notes = mem::take(&mut *self.notes.lock().unwrap_or_else(PoisonError::into_inner));
        let mut answers = notes.answers;
        answers.sort_by_key(|(call, _)| *call);
        answers
    }

    /// Notes that a question was asked, and the answer to it if there is one.
    fn note(&self, question: HookQuestion, pair: &HookedPair<'_>, answer: Option<HookAnswer>) {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        let call = notes.asked.again(question, pair);
        notes.answers.extend(answer.map(|answer| (call, answer)));
    }
}

impl ContactHooks for NotedHooks {
    fn filter_contact_pair(&self, pair: &HookedPair<'_>) -> Option<SolverFlags> {
        let flags = self.hooks.filter_contact_pair(pair);
        let is_usual = flags == Some(SolverFlags::COMPUTE_RIGID_IMPULSES);
        let answer = (!is_usual).then(|| HookAnswer::Contact(flags.map(|flags| flags.bits())));
        self.note(HookQuestion::Contact, pair, answer);
        flags
    }

    fn filter_intersection_pair(&self, pair: &HookedPair<'_>) -> bool {
        let is_seen = self.hooks.filter_intersection_pair(pair);
        self.note(HookQuestion::Intersection, pair, (!is_seen).then_some(HookAnswer::Unseen));
        is_seen
    }

    fn modify_solver_contacts(&self, pair: &HookedPair<'_>, contacts: &mut ContactModificationContext<'_>) {
        let before = Manifold::of(contacts);
        self.hooks.modify_solver_contacts(pair, contacts);
        let after = Manifold::of(contacts);
        let answer = (after != before).then_some(HookAnswer::Solver(after));
        self.note(HookQuestion::Solver, pair, answer);
    }
}

impl RepeatedHooks {
    pub(crate) fn new(answers: Vec<(HookCall, HookAnswer)>) -> Self {
        Self { answers: answers.into_iter().collect(), asked: Mutex::default() }
    }

    /// Returns the answer to a question; `None` where it is as without hooks.
    fn answer(&self, question: HookQuestion, pair: &HookedPair<'_>) -> Option<&HookAnswer> {
        let call = self.asked.lock().unwrap_or_else(PoisonError::into_inner).again(question, pair);
        self.answers.get(&call)
    }
}

impl ContactHooks for RepeatedHooks {
    fn filter_contact_pair(&self, pair: &HookedPair<'_>) -> Option<SolverFlags> {
        match self.answer(HookQuestion::Contact, pair) {
            Some(HookAnswer::Contact(bits)) => bits.map(SolverFlags::from_bits_truncate),
            _ => Some(SolverFlags::COMPUTE_RIGID_IMPULSES),
        }
    }

    fn filter_intersection_pair(&self, pair: &HookedPair<'_>) -> bool {
        self.answer(HookQuestion::Intersection, pair) != Some(&HookAnswer::Unseen)
    }

    fn modify_solver_contacts(&self, pair: &HookedPair<'_>, contacts: &mut ContactModificationContext<'_>) {
        let answer = self.answer(HookQuestion::Solver, pair);
        if let Some(HookAnswer::Solver(bytes)) = answer
            && let Ok(manifold) = read_state::<Manifold>(&mut &bytes[..])
        {
            manifold.put(contacts);
        }
    }
}

/// The parts of a contact manifold that a hook may change.
#[derive(Serialize, Deserialize)]
struct Manifold {
    solver_contacts: SolverContacts,
    normal: Vector,
    friction: f32,
    restitution: f32,
    user_data: u32,
}

impl Manifold {
    /// Returns the present manifold in Rapier's serde form; nothing of soft bodies, which no region has.
    fn of(contacts: &ContactModificationContext<'_>) -> Vec<u8> {
        let mut bytes = Vec::new();
        if let Some(now) = contacts.rigid() {
            let manifold = Self {
                solver_contacts: now.solver_contacts.clone(),
                normal: *now.normal,
                friction: *now.friction,
                restitution: *now.restitution,
                user_data: *now.user_data,
            };
            write_state(&manifold, &mut bytes).expect("plain values in memory encode");
        }
        bytes
    }

    /// Has no effect on a contact that is not the one which was recorded: Rapier would look for points that are not there.
    fn put(self, contacts: &mut ContactModificationContext<'_>) {
        let is_there = |points: usize| {
            let mut of = self.solver_contacts.iter().flat_map(|contact| contact.contact_indices());
            of.all(|index| (index as usize) < points)
        };
        if let Some(now) = contacts.rigid_mut().filter(|now| is_there(now.manifold.points.len())) {
            *now.solver_contacts = self.solver_contacts;
            (*now.normal, *now.friction, *now.restitution, *now.user_data) =
                (self.normal, self.friction, self.restitution, self.user_data);
        }
    }
}
