//! Chooses which bodies a client predicts: those that its avatars may touch within a second, the bodies tied
//! to them, and the scenery around.

use std::collections::{BTreeSet, VecDeque};

use crate::cluster::{BodyView, Client};
use crate::protocol::{BodyKind, BodyRecord, JointRecord, ShapeHash, ShapeRecord};
use crate::space::BodyId;

/// The number of bodies looked at in one frame: a larger world takes several frames.
const LOOKS: usize = 1_024;
/// The most movable bodies that are predicted, avatars included, and the most immovable ones.
const MOVABLE: usize = 64;
const SCENERY: usize = 256;
/// The most avatars around which bodies are searched.
const AVATARS: usize = 16;
/// The gap to an avatar within which bodies are predicted, metres; larger by what the two may come closer in
/// a second.
const GAP_M: f64 = 8.0;
/// How much farther away a predicted body stays predicted, metres.
const HYSTERESIS_M: f64 = 2.0;
/// The time within which bodies may meet, seconds.
const AHEAD_S: f64 = 1.0;
/// The highest speed towards an avatar that counts, m/s.
const FASTEST_M_S: f64 = 50.0;

/// An own avatar, as a moving ball.
#[derive(Clone, Copy, Debug)]
struct Avatar {
    place: [f64; 3],
    velocity: [f32; 3],
    reach_m: f64,
}

impl Avatar {
    /// Returns the gap to a moving body, less what the two may come closer within a second, metres.
    fn gap_m(&self, body: &BodyRecord, reach_m: f64) -> f64 {
        let apart = (0..3).map(|i| (body.state.pose.translation[i] - self.place[i]).powi(2));
        let apart_m = apart.sum::<f64>().sqrt();
        let speed = (0..3).map(|i| f64::from(body.state.velocity.linear[i] - self.velocity[i]).powi(2));
        apart_m - self.reach_m - reach_m - AHEAD_S * speed.sum::<f64>().sqrt().min(FASTEST_M_S)
    }
}

/// The bodies to predict.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Chosen {
    pub(super) movable: BTreeSet<BodyId>,
    pub(super) scenery: BTreeSet<BodyId>,
}

/// A search through a client's bodies for those to predict. It takes some bodies in each frame.
#[derive(Debug, Default)]
pub(super) struct Search {
    avatars: Vec<Avatar>,
    /// The body looked at last; `None` before a search begins.
    last: Option<BodyId>,
    movable: Vec<(f64, BodyId)>,
    scenery: Vec<(f64, BodyId)>,
}

impl Search {
    /// Looks at some bodies. Once all were looked at, returns those to predict. `present` are predicted now.
    pub(super) fn go_on(&mut self, client: &Client, present: &Chosen) -> Option<Chosen> {
        let find = |hash| client.shapes().get(&hash);
        if self.last.is_none() {
            *self = Self::default();
            self.avatars = client.own_avatars().take(AVATARS).map(|view| avatar(view, find)).collect();
            if self.avatars.is_empty() {
                return Some(Chosen::default());
            }
        }
        let mut looked = 0;
        for view in client.bodies_after(self.last).take(LOOKS) {
            looked += 1;
            self.last = Some(view.body.id);
            let gap_m = self.gap_m(&view.body, find);
            if view.body.traits.kind == BodyKind::Fixed {
                if gap_m < GAP_M {
                    self.scenery.push((gap_m, view.body.id));
                }
                continue;
            }
            let stays_m = if present.movable.contains(&view.body.id) { HYSTERESIS_M } else { 0.0 };
            let gap_m =
                if view.body.id.client() == Some(client.id()) { f64::NEG_INFINITY } else { gap_m - stays_m };
            if gap_m < GAP_M && !view.outside {
                self.movable.push((gap_m, view.body.id));
            }
        }
        if looked == LOOKS {
            return None;
        }
        self.last = None;
        let movable = nearest(std::mem::take(&mut self.movable), MOVABLE);
        let scenery = nearest(std::mem::take(&mut self.scenery), SCENERY);
        Some(tied(client, movable, scenery))
    }

    fn gap_m<'a>(&self, body: &BodyRecord, find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>) -> f64 {
        let nearest = |reach_m: f64| {
            self.avatars.iter().map(|avatar| avatar.gap_m(body, reach_m)).fold(f64::INFINITY, f64::min)
        };
        // Few bodies are near, so the shapes of most need no look.
        let as_point_m = nearest(0.0);
        if as_point_m < GAP_M { as_point_m } else { as_point_m - body.reach_m(find) }
    }
}

fn avatar<'a>(view: &BodyView, find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>) -> Avatar {
    let state = &view.body.state;
    Avatar {
        place: state.pose.translation,
        velocity: view.body.asked().linear,
        reach_m: view.body.reach_m(find),
    }
}

fn nearest(mut bodies: Vec<(f64, BodyId)>, most: usize) -> BTreeSet<BodyId> {
    bodies.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    bodies.into_iter().take(most).map(|(_, id)| id).collect()
}

/// Adds the bodies that joints tie to the chosen ones. An assembly is left out whole if it is too large, or
/// if it has a multibody, which cannot be put into a state from outside.
fn tied(client: &Client, movable: BTreeSet<BodyId>, mut scenery: BTreeSet<BodyId>) -> Chosen {
    let kind = |id: &BodyId| client.body(*id).map(|view| view.body.traits.kind);
    let is_movable = |id: &BodyId| kind(id).is_some_and(|kind| kind != BodyKind::Fixed);
    let mut all = movable;
    spread(client, &mut all, |id, size| size < 2 * MOVABLE && is_movable(id));
    let is_left_out = |id: &BodyId| is_movable(id) && !all.contains(id);
    let parts = || all.iter().flat_map(|id| client.joints_of(*id));
    let broken =
        parts().filter(|joint| joint.link.is_some() || is_left_out(&joint.a) || is_left_out(&joint.b));
    let mut without: BTreeSet<_> = broken.flat_map(|joint| [joint.a, joint.b]).collect();
    spread(client, &mut without, |id, _| all.contains(id));
    let anchors = parts().flat_map(|joint| [joint.a, joint.b]);
    scenery.extend(anchors.filter(|id| kind(id) == Some(BodyKind::Fixed)));
    Chosen { movable: all.difference(&without).copied().collect(), scenery }
}

/// Adds the bodies that are tied to these, directly or through others, as far as allowed. `is_allowed` takes
/// a body, and how many there are so far.
fn spread(client: &Client, bodies: &mut BTreeSet<BodyId>, is_allowed: impl Fn(&BodyId, usize) -> bool) {
    let mut new: VecDeque<_> = bodies.iter().copied().collect();
    while let Some(body) = new.pop_front() {
        let other = |joint: &JointRecord| if joint.a == body { joint.b } else { joint.a };
        let mut tied: Vec<_> = client.joints_of(body).map(other).collect();
        tied.sort_unstable();
        for other in tied {
            #[cfg(test)]
            tests::LOOKS.set(tests::LOOKS.get() + 1);
            if !bodies.contains(&other) && is_allowed(&other, bodies.len()) {
                bodies.insert(other);
                new.push_back(other);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::time::Duration;

    use super::*;
    use crate::cluster::{ClientEvent, Peer};
    use crate::protocol::{Chunk, Message, ToClient};
    use crate::space::{ClientId, JointId};

    thread_local! {
        pub(super) static LOOKS: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn what_joints_tie_is_found_in_as_many_looks_as_joints_hold_it() {
        let rope = rapier3d::prelude::RopeJointBuilder::new(1.0).build();
        let [base, end] = [1_000_000, 1_000].map(BodyId::persistent);
        // The far end comes first. Each link is also tied to a body that is not allowed.
        let links = (0..1_000).rev().map(BodyId::persistent);
        let ties = links.flat_map(|id| [(id, BodyId::persistent(id.index() + 1)), (base, id)]);
        // As many joints between other bodies.
        let elsewhere = (2_000..4_000).map(|i| (BodyId::persistent(i), BodyId::persistent(i + 1)));
        let joints = (0..).zip(ties.chain(elsewhere));
        let joints = joints.map(|(id, (a, b))| crate::physics::joint_record(JointId(id), a, b, &rope.into()));
        let message = ToClient::Chunk(Chunk::Joints(joints.collect()));
        let message = Message::ToClient(ClientId(1), message);
        let mut client = Client::new(ClientId(1), None, None);
        client.handle(Duration::ZERO, ClientEvent::Message { from: Peer::Server, message });
        let mut bodies = BTreeSet::from([BodyId::persistent(0)]);
        let before = LOOKS.get();
        spread(&client, &mut bodies, |id, _| *id != base);
        assert_eq!((bodies.len(), bodies.last()), (1_001, Some(&end)));
        let looks = LOOKS.get() - before;
        assert!(looks <= 3_000, "{looks} looks at joints of the rope, from both ends and from the base");
        let before = LOOKS.get();
        spread(&client, &mut BTreeSet::from([BodyId::persistent(7)]), |_, _| false);
        assert_eq!(LOOKS.get() - before, 3);
    }
}
