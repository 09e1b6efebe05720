//! Simulates how links begin and end: calls, time-outs, closings, cuts, stops and deaths.

use std::collections::BTreeSet;
use std::time::Duration;

use super::link::{LANES, Link, LinkId, Side, State};
use super::{Arrival, Cut, Delivery, Event, Network};
use crate::cluster::Peer;
use crate::protocol::link::{FIRST_PROBE, KEEP_ALIVE, LINGER};

impl Network {
    /// Closes a process's link to another. The messages that it has sent arrive, then the other end hears of
    /// the closing.
    pub(in crate::sim) fn close(&mut self, now: Duration, from: Peer, to: Peer) {
        self.waiting.remove(&(from, to));
        if let Some(id) = self.current.get(&(from, to)).copied() {
            self.hang_up(now, id, from);
        }
    }

    /// Breaks the link between two processes at both ends, and loses what is under way. They can call each
    /// other again.
    pub(in crate::sim) fn break_link(&mut self, a: Peer, b: Peer) {
        let Some(id) = self.current.get(&(a, b)).copied() else { return };
        for side in Side::BOTH {
            for lane in 0..LANES {
                if let Some(link) = self.links.get_mut(&id) {
                    link.end_mut(side).drop_frames(lane);
                }
            }
        }
        for side in Side::BOTH {
            self.gone(id, side);
        }
    }

    /// Applies a cut until its end.
    pub(in crate::sim) fn cut(&mut self, now: Duration, cut: Cut) {
        self.push(cut.until, Event::Healed);
        for (id, side) in self.open_ends() {
            let link = &self.links[&id];
            if cut.stops(link.end(side.other()).who, link.end(side).who) {
                self.deafen(now, id, side);
            }
        }
        self.cuts.push(cut);
    }

    /// Kills a process without a word. On each of its lanes, what is under way either arrives or is lost.
    pub(in crate::sim) fn crash(&mut self, now: Duration, dead: Peer) {
        self.alive.remove(&dead);
        let is_its = |event: &Event| matches!(event, Event::Physics(node, _) if Peer::Node(*node) == dead);
        self.queue.retain(|_, event| !is_its(event));
        self.ready.retain(|delivery| delivery.to != dead);
        self.waiting.retain(|&(from, _), _| from != dead);
        self.current.retain(|&(own, _), _| own != dead);
        self.hung_up.retain(|&(own, _)| own != dead);
        self.datagrams.remove(&dead);
        for (id, side) in self.ends_of(dead) {
            let lost: Vec<usize> = (0..LANES).filter(|_| self.random.chance(0.5)).collect();
            let Some(link) = self.links.get_mut(&id) else { continue };
            let end = link.end_mut(side);
            lost.into_iter().for_each(|lane| end.drop_frames(lane));
            (end.state, end.lingers) = (State::Closed, false);
            let other = link.end_mut(side.other());
            (0..LANES).for_each(|lane| other.drop_frames(lane));
            other.lingers = false;
            self.deafen(now, id, side.other());
            // A killed process says nothing; one that panics may still say that it closes.
            if self.random.chance(0.25) {
                let soon = now + self.random.up_to(Duration::from_millis(40));
                self.push(soon, Event::Closed(id, side.other()));
            }
            self.tidy(id);
        }
    }

    /// Lets the peers of a restarted process hear of its restart when they next send over the links of its
    /// predecessor. A node may be back at another address, where no peer asks about these links. But then its
    /// clients are told so, and only clients' links last for long.
    pub(super) fn recall(&mut self, now: Duration, who: Peer) {
        for (id, side) in self.ends_of(who) {
            let link = &self.links[&id];
            let is_forgotten = link.end(side).state == State::Closed && link.is_open(side.other());
            if is_forgotten && (who == Peer::Server || link.is_calm()) {
                self.probe_later(now, id, side.other());
            }
        }
    }

    /// Stops a process.
    pub(in crate::sim) fn stop(&mut self, now: Duration, who: Peer) {
        self.alive.insert(who, Some(now));
        for (id, side) in self.ends_of(who) {
            self.deafen(now, id, side.other());
        }
    }

    /// Resumes a process. Returns those of its links that ended before it has read what came over them.
    pub(in crate::sim) fn resume(&mut self, now: Duration, who: Peer) -> BTreeSet<LinkId> {
        let mut ended = BTreeSet::new();
        let Some(since) = self.alive.insert(who, None).flatten() else { return ended };
        for (id, side) in self.ends_of(who) {
            if self.is_audible(now, id, side.other()) {
                let soon = now + self.random.up_to(Duration::from_millis(30));
                self.push(soon, Event::Hears(id, side.other()));
            }
            let link = &self.links[&id];
            let heard = link.end(side).deaf.map_or(since, |deaf| deaf.min(since));
            if !link.is_open(side) || heard + link.idle_timeout() > now {
                continue;
            }
            // Packets lie in its buffer unless it was deaf before. Chance decides whether these or the
            // time-out come first.
            let has_packets = link.end(side).deaf.is_none_or(|deaf| deaf > since);
            if has_packets && self.random.chance(0.5) {
                self.hear(now, id, side);
                if !self.is_audible(now, id, side) {
                    self.deafen(now, id, side);
                    let soon = now + self.random.up_to(Duration::from_millis(30));
                    self.push(soon, Event::Probe(id, side));
                }
            } else {
                ended.insert(id);
                self.expire(now, id, side);
            }
        }
        ended
    }

    pub(in crate::sim) fn is_stopped(&self, who: Peer) -> bool {
        self.alive.get(&who).is_some_and(Option::is_some)
    }

    /// Executes an event of a link, frames excepted.
    pub(super) fn live(&mut self, now: Duration, event: Event) {
        match event {
            Event::Dial(id, attempt) => self.dialled(now, id, attempt),
            Event::Listen(id, attempt) => self.listened(now, id, attempt),
            Event::Open(id) => self.opened(now, id),
            Event::GiveUp(id) if self.is_opening(id) => self.expire(now, id, Side::Dialler),
            Event::GiveUp(_) => {}
            Event::Idle(id, side, since) => {
                let is_due = |link: &Link| link.is_open(side) && link.end(side).deaf == Some(since);
                if self.links.get(&id).is_some_and(is_due) && !self.is_stopped(self.links[&id].end(side).who)
                {
                    self.expire(now, id, side);
                }
            }
            Event::Hears(id, side) => {
                if self.is_audible(now, id, side) {
                    self.hear(now, id, side);
                }
            }
            Event::Probe(id, side) => self.probe(now, id, side),
            Event::Closed(id, side) => self.closed(now, id, side),
            Event::Linger(id, side) => {
                let Some(link) = self.links.get_mut(&id) else { return };
                if std::mem::take(&mut link.end_mut(side).lingers) {
                    self.tell_closed(now, id, side.other());
                    self.tidy(id);
                }
            }
            Event::Healed => self.healed(now),
            Event::Packets(..) | Event::Datagram(..) | Event::Physics(..) | Event::Resend(..) => {
                unreachable!("not of a link's life")
            }
        }
    }

    fn is_opening(&self, id: LinkId) -> bool {
        self.links.get(&id).is_some_and(|link| link.end(Side::Dialler).state == State::Opening)
    }

    fn ends_of(&self, who: Peer) -> Vec<(LinkId, Side)> {
        let side = |link: &Link| Side::BOTH.into_iter().find(|&side| link.end(side).who == who);
        self.links.iter().filter_map(|(&id, link)| Some((id, side(link)?))).collect()
    }

    fn open_ends(&self) -> Vec<(LinkId, Side)> {
        let ends = self.links.iter().flat_map(|(&id, link)| Side::BOTH.map(|side| (id, link, side)));
        ends.filter(|(_, link, side)| link.is_open(*side)).map(|(id, _, side)| (id, side)).collect()
    }

    fn is_running(&self, who: Peer) -> bool {
        self.alive.get(&who).is_some_and(Option::is_none)
    }

    /// Returns whether packets of the other end reach this end.
    fn is_audible(&self, now: Duration, id: LinkId, side: Side) -> bool {
        let Some(link) = self.links.get(&id) else { return false };
        let (own, other) = (link.end(side), link.end(side.other()));
        other.state != State::Closed && self.is_running(other.who) && self.passes(now, other.who, own.who)
    }

    /// Notes that an end hears something, perhaps for the last time in a while.
    pub(super) fn hear(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get_mut(&id) else { return };
        if link.end_mut(side).deaf.take().is_some() && link.is_open(side) && !self.is_audible(now, id, side) {
            self.deafen_since(now, id, side);
        }
    }

    /// Notes that an end hears nothing from now on. The last that it heard was a keep-alive some time ago, or
    /// anything since.
    fn deafen(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(keep_alive) = self.links.get(&id).map(Link::keep_alive) else { return };
        let since = now.saturating_sub(self.random.up_to(keep_alive));
        self.deafen_since(since, id, side);
    }

    fn deafen_since(&mut self, since: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get_mut(&id) else { return };
        if link.is_open(side) && link.end(side).deaf.is_none() {
            link.end_mut(side).deaf = Some(since);
            let idle_timeout = link.idle_timeout();
            self.push(since + idle_timeout, Event::Idle(id, side, since));
        }
    }

    fn healed(&mut self, now: Duration) {
        self.cuts.retain(|cut| now < cut.until);
        for (id, side) in self.open_ends() {
            if self.links[&id].end(side).deaf.is_some() && self.is_audible(now, id, side) {
                let soon = now + self.random.up_to(self.links[&id].keep_alive());
                self.push(soon, Event::Hears(id, side));
            }
        }
    }

    /// Returns the time of one flight of a handshake, including repeats after loss.
    fn flight(&mut self, from: Peer, to: Peer) -> Duration {
        let mut time = self.delay(from, to);
        for retries in 0..6 {
            if !self.random.chance(self.conditions.loss) {
                break;
            }
            time += self.patience(from, to, retries, KEEP_ALIVE);
        }
        time
    }

    fn dialled(&mut self, now: Duration, id: LinkId, attempt: u32) {
        if !self.is_opening(id) {
            return;
        }
        let [from, to] = Side::BOTH.map(|side| self.links[&id].end(side).who);
        let is_answered = self.is_running(from)
            && self.is_running(to)
            && self.passes(now, from, to)
            && self.passes(now, to, from)
            && !self.random.chance(self.conditions.loss);
        if is_answered {
            let time = now + self.flight(from, to) + self.flight(to, from) + self.flight(from, to);
            self.push(time, Event::Listen(id, attempt));
        } else {
            self.dial_again(now, id, attempt);
        }
    }

    /// Sends an unanswered first packet again, each time after twice as long.
    fn dial_again(&mut self, now: Duration, id: LinkId, attempt: u32) {
        self.push(now + FIRST_PROBE * (1 << attempt.min(8)), Event::Dial(id, attempt + 1));
    }

    fn listened(&mut self, now: Duration, id: LinkId, attempt: u32) {
        if !self.is_opening(id) {
            return;
        }
        let [from, to] = Side::BOTH.map(|side| self.links[&id].end(side).who);
        if !self.is_running(to) || !self.passes(now, from, to) {
            return self.dial_again(now, id, attempt);
        }
        self.begin(now, id, Side::Listener);
        let time = now + self.flight(to, from);
        self.push(time, Event::Open(id));
    }

    fn opened(&mut self, now: Duration, id: LinkId) {
        if !self.is_opening(id) {
            return;
        }
        let [from, to] = Side::BOTH.map(|side| self.links[&id].end(side).who);
        if !self.links[&id].is_open(Side::Listener) {
            return;
        }
        if self.is_running(from) && self.is_running(to) && self.passes(now, to, from) {
            self.begin(now, id, Side::Dialler);
        } else {
            self.push(now + KEEP_ALIVE, Event::Open(id));
        }
    }

    /// Opens an end of a link. An earlier link of the same two processes ends here.
    fn begin(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get_mut(&id) else { return };
        link.end_mut(side).state = State::Open;
        let (own, other) = (link.end(side).who, link.end(side.other()).who);
        if let Some(&former) = self.current.get(&(own, other)) {
            self.hang_up(now, former, own);
        }
        self.current.insert((own, other), id);
        self.ready.push_back(Delivery { to: own, link: None, arrival: Arrival::Connected(other) });
        for (lane, bytes) in self.waiting.remove(&(own, other)).unwrap_or_default().frames {
            if let Some(lane) = super::index(lane) {
                self.send_frame(now, id, own, lane, bytes);
            }
        }
        self.give(now, id, side.other());
        if !self.is_audible(now, id, side) {
            self.deafen(now, id, side);
        }
    }

    /// Ends a link for a process that wants no more of it and is not told of its end.
    fn hang_up(&mut self, now: Duration, id: LinkId, who: Peer) {
        let Some(link) = self.links.get_mut(&id) else { return };
        let side = link.side_of(who);
        let other = link.end(side.other()).who;
        let end = link.end_mut(side);
        (end.state, end.lingers) = (State::Closed, true);
        self.hung_up.insert((who, id));
        if self.current.get(&(who, other)) == Some(&id) {
            self.current.remove(&(who, other));
        }
        self.push(now + LINGER, Event::Linger(id, side));
        self.give(now, id, side);
        self.tidy(id);
    }

    /// Sends this end the message that the other end has closed.
    pub(super) fn tell_closed(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get(&id) else { return };
        let (own, other) = (link.end(side).who, link.end(side.other()).who);
        if self.passes(now, other, own) && !self.random.chance(self.conditions.loss) {
            let time = now + self.delay(other, own);
            self.push(time, Event::Closed(id, side));
        } else {
            self.deafen(now, id, side);
            self.probe_later(now, id, side);
        }
    }

    fn closed(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get(&id) else { return };
        let (own, other) = (link.end(side).who, link.end(side.other()).who);
        if self.passes(now, other, own) {
            self.gone(id, side);
        } else {
            self.deafen(now, id, side);
            self.probe_later(now, id, side);
        }
    }

    /// Closes the sender's end because the reader does not read. The reader hears of it if it ever listens.
    pub(super) fn overflow(&mut self, now: Duration, id: LinkId, side: Side) {
        self.traffic.overflows += 1;
        if let Some(link) = self.links.get_mut(&id) {
            (0..LANES).for_each(|lane| link.end_mut(side).drop_frames(lane));
        }
        self.gone(id, side);
        self.tell_closed(now, id, side.other());
    }

    /// Closes an end that has heard nothing for too long.
    fn expire(&mut self, now: Duration, id: LinkId, side: Side) {
        self.gone(id, side);
        self.deafen(now, id, side.other());
        self.probe_later(now, id, side.other());
    }

    /// Lets an end find out by its next keep-alive that the other end has forgotten the link.
    fn probe_later(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get(&id) else { return };
        if side == Side::Dialler || !link.is_calm() {
            let time = now + self.random.up_to(link.keep_alive());
            self.push(time, Event::Probe(id, side));
        }
    }

    /// Lets an end find out by what it sends that the other end has forgotten a calm link. Other links do not
    /// wait for that.
    pub(super) fn probe_by_sending(&mut self, now: Duration, id: LinkId, side: Side) {
        let is_over = |link: &Link| link.is_calm() && link.end(side.other()).state == State::Closed;
        if self.links.get(&id).is_some_and(is_over) {
            self.push(now, Event::Probe(id, side));
        }
    }

    /// Answers a packet by a reset if its link is one that the other process has forgotten.
    fn probe(&mut self, now: Duration, id: LinkId, side: Side) {
        let Some(link) = self.links.get(&id).filter(|link| link.is_open(side)) else { return };
        let (own, other) = (link.end(side).who, link.end(side.other()).who);
        let is_forgotten = link.end(side.other()).state == State::Closed;
        if !is_forgotten || !self.alive.contains_key(&other) {
            return;
        }
        let is_answered = self.is_running(own) && self.is_running(other) && self.passes(now, own, other);
        if is_answered && self.passes(now, other, own) && !self.random.chance(self.conditions.loss) {
            let time = now + self.delay(own, other) + self.delay(other, own);
            self.push(time, Event::Closed(id, side));
        } else {
            self.push(now + KEEP_ALIVE, Event::Probe(id, side));
        }
    }

    /// Ends the link at this end. The process hears of it unless it has closed the link itself.
    fn gone(&mut self, id: LinkId, side: Side) {
        let Some(link) = self.links.get_mut(&id) else { return };
        let (own, other) = (link.end(side).who, link.end(side.other()).who);
        let end = link.end_mut(side);
        let before = std::mem::replace(&mut end.state, State::Closed);
        (0..LANES).for_each(|lane| end.drop_frames(lane));
        let was_current = self.current.get(&(own, other)) == Some(&id);
        if was_current {
            self.current.remove(&(own, other));
        }
        let is_told = match before {
            State::Open => was_current,
            State::Opening => side == Side::Dialler,
            State::Closed => false,
        };
        if is_told {
            self.waiting.remove(&(own, other));
            let arrival = match before {
                State::Open => Arrival::Disconnected(other),
                _ => Arrival::Unanswered(other),
            };
            self.ready.push_back(Delivery { to: own, link: Some(id), arrival });
        }
        self.tidy(id);
    }

    fn tidy(&mut self, id: LinkId) {
        if self.links.get(&id).is_some_and(Link::is_over) {
            self.links.remove(&id);
        }
    }
}
