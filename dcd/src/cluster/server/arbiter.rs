//! Decides which group is authoritative for a body, and forwards states between groups (inter-group, thesis
//! 3.3.8, 4.3.2.10).

use std::collections::BTreeMap;

use super::Server;
use super::group::Group;
use crate::delta::alone;
use crate::protocol::{STATES_BYTES, SharedState, Stance, ToNode, ViewNumber};
use crate::space::{BodyId, GroupId, NodeId, Tick};

/// The groups that are authoritative for bodies for which the main group is not.
#[derive(Clone, Debug, Default)]
pub(super) struct Arbiter {
    /// The group whose avatar last touched each body, and how often that group has changed.
    touched: BTreeMap<BodyId, (u32, GroupId)>,
    /// The groups that were there when all touched bodies were last looked at, the main group first.
    looked_at: Vec<GroupId>,
    /// What each leader was last told: its view, whether its group is alone, and whether it is the main
    /// group.
    told: BTreeMap<GroupId, (ViewNumber, bool, bool)>,
}

impl Server {
    /// Returns the group that is authoritative for a body. For an avatar, it is the group of its client. For
    /// another body, it is the group whose avatar touched it last. Else it is the main group.
    pub fn authoritative(&self, body: BodyId) -> GroupId {
        let group = match body.client() {
            Some(client) => self.common.clients.get(&client).map(|entry| entry.group),
            None => self.arbiter.touched.get(&body).map(|&(_, group)| group),
        };
        group.filter(|group| self.groups.get(group).is_some_and(lives)).unwrap_or(self.main)
    }

    /// Returns the group that this node leads in the view of this number.
    fn led_by(&self, node: NodeId, view: ViewNumber) -> Option<GroupId> {
        let leads =
            |group: &&Group| group.view.as_ref().is_some_and(|v| v.leader == node && v.number == view);
        self.groups.values().find(leads).map(|group| group.id)
    }

    /// Forwards states of bodies to all other groups, as far as the sender's group is authoritative for these
    /// bodies.
    pub(super) fn inter_group(&mut self, node: NodeId, view: ViewNumber, tick: Tick, states: Vec<u8>) {
        let Some(from) = self.led_by(node, view) else {
            self.common.stale += 1;
            return;
        };
        let Ok(told) = alone::read(&states) else {
            self.common.stale += 1;
            return;
        };
        let is_theirs = |state: &&SharedState| self.authoritative(state.id) == from;
        let kept: Vec<_> = told.iter().filter(is_theirs).copied().collect();
        self.common.stale += (told.len() - kept.len()) as u64;
        let parts = if kept.len() == told.len() { vec![states] } else { alone::write(&kept, STATES_BYTES) };
        let main = from == self.main;
        for group in self.groups.values().filter(|group| group.id != from && lives(group)) {
            let Some(view) = &group.view else { continue };
            if main || !kept.is_empty() {
                for states in parts.clone() {
                    let message = ToNode::InterGroup { view: view.number, main, tick, states };
                    self.common.send_node(view.leader, message);
                }
            }
        }
    }

    /// Makes a group authoritative for bodies that its avatars have touched, if the group knew which group
    /// was authoritative before.
    pub(super) fn touched(&mut self, node: NodeId, view: ViewNumber, bodies: Vec<(BodyId, u32)>) {
        let Some(from) = self.led_by(node, view) else {
            self.common.stale += 1;
            return;
        };
        let mut news = Vec::new();
        for (body, number) in bodies {
            let known = self.arbiter.touched.get(&body).map_or(0, |&(number, _)| number);
            let exists = body.client().is_none() && self.record().body(body).is_some();
            if exists && number == known + 1 {
                self.arbiter.touched.insert(body, (number, from));
            } else {
                self.common.stale += 1;
            }
            if exists {
                news.push(body);
            }
        }
        for id in self.groups.values().filter(|group| lives(group)).map(|group| group.id).collect::<Vec<_>>()
        {
            self.tell_authority(id, &news);
        }
    }

    /// Tells new leaders for which bodies their group is authoritative, and tells all leaders when groups
    /// come and go.
    pub(super) fn tell_leaders(&mut self) {
        let living: Vec<_> =
            self.groups.values().filter(|group| lives(group)).map(|group| group.id).collect();
        let alone = living.len() <= 1;
        self.arbiter.told.retain(|id, _| self.groups.contains_key(id));
        let orphans = self.take_over_orphans(&living);
        for id in living {
            let Some(view) = &self.groups[&id].view else { continue };
            let state = (view.number, alone, id == self.main);
            if self.arbiter.told.insert(id, state) != Some(state) {
                let bodies: Vec<_> = self.arbiter.touched.keys().copied().collect();
                self.tell_authority(id, &bodies);
            } else if !orphans.is_empty() {
                self.tell_authority(id, &orphans);
            }
        }
    }

    /// Makes the main group authoritative for bodies whose group is gone, with a number that no leader has
    /// heard, and returns these bodies. Forgets bodies that are gone themselves. Does nothing unless groups
    /// have come or gone.
    fn take_over_orphans(&mut self, living: &[GroupId]) -> Vec<BodyId> {
        let groups: Vec<_> = [self.main].into_iter().chain(living.iter().copied()).collect();
        if groups == self.arbiter.looked_at {
            return Vec::new();
        }
        self.arbiter.looked_at = groups;
        let record = &self.groups[&self.main].record;
        self.arbiter.touched.retain(|&body, _| record.body(body).is_some());
        let mut orphans = Vec::new();
        for (&body, (number, group)) in &mut self.arbiter.touched {
            if *group != self.main && !living.contains(group) {
                (*number, *group) = (*number + 1, self.main);
                orphans.push(body);
            }
        }
        orphans
    }

    fn tell_authority(&mut self, id: GroupId, bodies: &[BodyId]) {
        let alone = self.groups.values().filter(|group| lives(group)).count() <= 1;
        let Some(view) = &self.groups[&id].view else { return };
        let stance = |&body: &BodyId| {
            let (number, group) = self.arbiter.touched.get(&body).copied().unwrap_or((0, self.main));
            Stance { body, number, yours: group == id }
        };
        let stances = bodies.iter().map(stance).collect();
        let message = ToNode::Authority { view: view.number, alone, by_default: id == self.main, stances };
        self.common.send_node(view.leader, message);
    }
}

fn lives(group: &Group) -> bool {
    group.view.is_some() && !group.held
}
