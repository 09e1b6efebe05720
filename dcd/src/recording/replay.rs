//! Replays processes together, in order of ticks, and finds where one of them parts from its recording.

use std::collections::BTreeMap;

use super::replayed::{Flip, Replayed, Settled, Who};
use super::{BodyBits, Changed, Cut, FIELDS, RecordingError, find_changed};
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// The point at which a replay parts from its recording. What a digest cannot tell is `None`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mismatch {
    /// The process whose replay parts.
    pub who: Who,
    /// The tick after which it parts.
    pub tick: Tick,
    /// The region; `None` if other regions were computed, or a server sent or stored something else.
    pub region: Option<RegionId>,
    /// The body.
    pub body: Option<BodyId>,
    /// The name of the field of the body's state.
    pub field: Option<&'static str>,
    /// The recorded value of the field, in m, m/s or rad/s; `None` if the body was not there.
    pub recorded: Option<f64>,
    /// The replayed value of the field.
    pub replayed: Option<f64>,
    /// What acted on the body in the ticks before, and what it touches.
    pub acted: Vec<String>,
}

/// The replay of the members of a cluster, or of a local world.
pub struct Replay {
    members: Vec<Member>,
    /// The tick at which the members began.
    began: Tick,
    ticks: u64,
    tick_count: u64,
    matches: u64,
    mismatch: Option<Mismatch>,
}

struct Member {
    /// The name of its recording.
    name: String,
    replay: Box<dyn Replayed>,
    /// The first tick that it completes, until the replay gets there: a member that joined late has nothing
    /// to show until then.
    first: Option<Settled>,
    tick: Tick,
    ended: bool,
}

impl Member {
    fn begin((name, mut replay): (String, Box<dyn Replayed>)) -> Result<Self, RecordingError> {
        match replay.advance() {
            Ok(first) => Ok(Self { name, replay, ended: first.is_none(), first, tick: Tick(0) }),
            Err(error) => Err(RecordingError::Of { name, error: Box::new(error) }),
        }
    }

    fn advance(&mut self) -> Result<Option<Settled>, RecordingError> {
        let of = |error| RecordingError::Of { name: self.name.clone(), error: Box::new(error) };
        self.replay.advance().map_err(of)
    }

    /// Returns the tick at which the member began; `None` if no tick is on record.
    fn began(&self) -> Option<Tick> {
        let first = self.first.as_ref()?;
        Some(self.replay.began().unwrap_or(first.tick))
    }

    /// Returns the tick that the member completes next, as far as that is known.
    fn next_tick(&self) -> Tick {
        self.first.as_ref().map_or(self.tick.next(), |first| first.tick)
    }
}

impl Replay {
    /// Begins the replay of these members, each with the name of its recording. A node that was started again
    /// is several members, of which the last counts. Fails if they are of several worlds, or one is a copy of
    /// another.
    pub fn new(members: Vec<(String, Box<dyn Replayed>)>) -> Result<Self, RecordingError> {
        let mut members = members.into_iter().map(Member::begin).collect::<Result<Vec<_>, _>>()?;
        check_one_world(&members)?;
        members.sort_by_key(|member| member.first.as_ref().map(|first| first.tick));
        let began = members.iter().filter_map(Member::began).min().unwrap_or(Tick(0));
        Ok(Self { members, began, ticks: 0, tick_count: 0, matches: 0, mismatch: None })
    }

    /// Returns the next tick to complete; `None` at the end.
    pub fn next_tick(&self) -> Option<Tick> {
        self.members.iter().filter(|member| !member.ended).map(Member::next_tick).min()
    }

    /// Completes the next tick of the member that is furthest behind, if that tick is at most `until`.
    /// Returns `false` when every member has ended or come that far.
    pub fn advance(&mut self, until: Tick) -> Result<bool, RecordingError> {
        let behind = self.members.iter_mut().filter(|member| !member.ended && member.next_tick() <= until);
        let Some(member) = behind.min_by_key(|member| (member.next_tick(), member.replay.who())) else {
            return Ok(false);
        };
        let settled = match member.first.take() {
            Some(first) => Some(first),
            None => member.advance()?,
        };
        let Some(settled) = settled else {
            member.ended = true;
            return Ok(true);
        };
        member.tick = member.tick.max(settled.tick);
        self.ticks = self.ticks.max(settled.tick.0);
        self.tick_count = match member.replay.who() {
            // It may go back, and be computed once more from there.
            Who::Local => self.tick_count + 1,
            _ => self.ticks.saturating_sub(self.began.0),
        };
        let regions = settled.recorded.len() as u64;
        if settled.recorded == settled.replayed {
            self.matches += regions;
        } else if self.mismatch.is_none() {
            self.mismatch = Some(explain(&*member.replay, &settled));
        }
        Ok(true)
    }

    /// Returns the newest tick that any member has completed.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Returns the number of ticks that were replayed.
    pub fn tick_count(&self) -> u64 {
        self.tick_count
    }

    /// Returns the newest tick that all running members have completed: those that have begun and not ended.
    /// If none runs, returns the newest tick of all members.
    pub fn tick(&self) -> Tick {
        let going = self.members.iter().filter(|member| !member.ended && member.first.is_none());
        going.map(|member| member.tick).min().unwrap_or(Tick(self.ticks))
    }

    /// Returns the members that are at that tick, or a tick ahead. Members that died before, come later, or
    /// have begun anew as another member are left out.
    fn present(&self) -> impl Iterator<Item = &Member> {
        let tick = self.tick();
        let is_present =
            move |member: &Member| member.first.is_none() && (tick..=tick.next()).contains(&member.tick);
        let begins_anew = move |at: usize, who: Who| {
            self.members[at + 1..].iter().any(|later| later.replay.who() == who && is_present(later))
        };
        let present = self
            .members
            .iter()
            .enumerate()
            .filter(move |(at, member)| is_present(member) && !begins_anew(*at, member.replay.who()));
        present.map(|(_, member)| member)
    }

    /// Returns the members that compute a part of the world at that tick.
    pub fn present_members(&self) -> impl Iterator<Item = &dyn Replayed> {
        self.present().map(|member| &*member.replay)
    }

    /// Returns the number of digests that were as recorded.
    pub fn matches(&self) -> u64 {
        self.matches
    }

    /// Returns where the replay first parted from the recording, if it did.
    pub fn mismatch(&self) -> Option<&Mismatch> {
        self.mismatch.as_ref()
    }

    /// Returns all members.
    pub fn members(&self) -> impl Iterator<Item = &dyn Replayed> {
        self.members.iter().map(|member| &*member.replay)
    }

    /// Returns the recordings that were found to have no end, each with its newest tick, 0 if it has none.
    pub fn cuts(&self) -> impl Iterator<Item = (&str, Tick, Cut)> {
        self.members.iter().filter_map(|member| Some((&*member.name, member.tick, member.replay.cut()?)))
    }

    /// Flips a bit of the body on the member that owns it after that tick.
    pub fn flip(&mut self, flip: Flip) {
        self.members.iter_mut().for_each(|member| member.replay.flip(flip));
    }

    /// Returns the node, the region and the state of each body.
    pub fn bodies(&self) -> BTreeMap<BodyId, (Option<NodeId>, RegionId, BodyBits)> {
        let mut found = BTreeMap::new();
        let mut present: Vec<_> = self.present().collect();
        present.sort_by_key(|member| member.tick);
        for Member { replay, .. } in present {
            let regions = replay.readout();
            for region in regions.regions() {
                let owned = regions.bodies(region);
                found.extend(owned.map(|(id, bits)| (id, (replay.who().node(), region, bits))));
            }
        }
        found
    }

    /// Returns in words what acted on a body in the last ticks, on every present member.
    pub fn acted_on(&self, body: BodyId) -> Vec<String> {
        self.present().flat_map(|member| acts(&*member.replay, body)).collect()
    }
}

/// Refuses recordings of several worlds, and copies.
fn check_one_world(members: &[Member]) -> Result<(), RecordingError> {
    // Those that end before their first tick have nothing to replay.
    let members = || members.iter().filter(|member| member.first.is_some());
    let mut worlds = members().filter_map(|member| Some((&member.name, member.replay.world()?)));
    if let Some((one, world)) = worlds.next()
        && let Some((other, _)) = worlds.find(|(_, of)| *of != world)
    {
        return Err(RecordingError::Unsuitable(format!(
            "{one} and {other} are of two worlds: replay the recordings of each world by themselves"
        )));
    }
    let mut known = BTreeMap::new();
    for Member { name, replay, .. } in members() {
        if let Some(other) = known.insert(replay.hash(), name) {
            return Err(RecordingError::Unsuitable(format!(
                "{name} is a copy of {other}: leave one of them out"
            )));
        }
    }
    Ok(())
}

/// Returns in words what acted on a body in the last ticks of one process, and what it touches there.
fn acts(replay: &dyn Replayed, body: BodyId) -> Vec<String> {
    let touching = replay.readout().touching(body).into_iter().map(|other| format!("touches {other}"));
    replay.acted_on(body).into_iter().chain(touching).collect()
}

/// Finds region, body and field of a difference.
fn explain(replay: &dyn Replayed, Settled { tick, recorded, replayed }: &Settled) -> Mismatch {
    let mut found = Mismatch {
        who: replay.who(),
        tick: *tick,
        region: None,
        body: None,
        field: None,
        recorded: None,
        replayed: None,
        acted: Vec::new(),
    };
    let regions = recorded.iter().map(|(region, _)| region);
    if found.who == Who::Server || !regions.eq(replayed.iter().map(|(region, _)| region)) {
        return found;
    }
    let differing = recorded.iter().zip(replayed).filter(|(recorded, replayed)| recorded != replayed);
    for (&(region, recorded), &(_, replayed)) in differing {
        found.region.get_or_insert(region);
        let bodies = replay.readout().bodies(region);
        if let Some(Changed { body, recorded, replayed }) = find_changed(recorded, replayed, bodies) {
            let field = recorded.zip(replayed).and_then(|(one, other)| one.first_difference(&other));
            let value = |bits: Option<BodyBits>| Some(bits?.value(field?));
            (found.region, found.body) = (Some(region), Some(body));
            (found.recorded, found.replayed) = (value(recorded), value(replayed));
            found.field = field.map(|field| FIELDS[field].0);
            found.acted = acts(replay, body);
            break;
        }
    }
    found
}
