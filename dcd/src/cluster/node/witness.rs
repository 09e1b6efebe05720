//! Tells a leader that verifies participants what this member hears from other members, and what it tells the
//! verified ones.

use crate::protocol::{Border, HeardBorder, Message, Testimony, Verified, ViewNumber};
use crate::space::{NodeId, Tick};

/// What a member has heard and told in the present tick, as far as the leader is to be told of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Witness {
    /// The participants that are verified in a view to come, and whether participants begin anew with it.
    coming: Option<(ViewNumber, Vec<Verified>, bool)>,
    /// The participants that are verified in the present view. `None`: the leader does not ask for testimony.
    verified: Option<Vec<Verified>>,
    anew: bool,
    heard: Vec<HeardBorder>,
    copies: Vec<Message>,
    /// What the leader was told of the newest tick. A link that breaks may lose it.
    told: Vec<Message>,
}

impl Witness {
    /// Takes in who is verified in a view to come.
    pub(super) fn learn(&mut self, view: ViewNumber, nodes: Vec<Verified>, anew: bool) {
        self.coming = Some((view, nodes, anew));
    }

    /// Begins a view.
    pub(super) fn begin(&mut self, view: ViewNumber) {
        let coming = self.coming.take().filter(|(of, ..)| *of == view);
        self.anew = coming.as_ref().is_some_and(|(.., anew)| *anew);
        self.verified = coming.map(|(_, nodes, _)| nodes);
        self.heard.clear();
        self.copies.clear();
    }

    /// Returns who is verified in the present view; `None` if the leader does not ask for testimony.
    pub(super) fn verified(&self) -> Option<&[Verified]> {
        self.verified.as_deref()
    }

    /// Returns whether participants begin the present view with nothing that they computed before.
    pub(super) fn begins_anew(&self) -> bool {
        self.anew
    }

    /// Notes what is told to another member.
    pub(super) fn tells(&mut self, to: NodeId, border: &Border) {
        if self.verified.iter().flatten().any(|verified| verified.node == to) {
            self.copies.push(Message::Copied { to, border: border.clone() });
        }
    }

    /// Notes what is taken in from another member.
    pub(super) fn hears(&mut self, from: NodeId, border: &Border) {
        if self.verified.is_some() {
            self.heard.push(HeardBorder { round: border.round, from, digest: border.digest() });
        }
    }

    /// Returns what the leader is to be told of a tick before it hears that this member is done with it.
    pub(super) fn testify(&mut self, view: ViewNumber, tick: Tick) -> Vec<Message> {
        self.told = std::mem::take(&mut self.copies);
        if self.verified.is_some() {
            let heard = std::mem::take(&mut self.heard);
            self.told.push(Message::Testimony(Testimony { view, tick, heard }));
        }
        self.told.clone()
    }

    /// Returns what the leader was told of the newest tick, to be told once more.
    pub(super) fn told(&self) -> Vec<Message> {
        self.told.clone()
    }
}
