//! Holds the data for viewers that several threads share: the one that steps the world, the one that encodes,
//! and one for each viewer.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tungstenite::Bytes;

use super::control::{Control, Next};
use super::sample::Sample;
use super::wire::{self, Hello};
use crate::drawing::{Details, FIRST_MESH, KEPT_FRAMES, Moment, Wishes};
use crate::protocol::Handover;
use crate::space::{BodyId, RegionId};

/// The most viewers at a time.
pub(super) const MOST_VIEWERS: usize = 8;
/// The most bytes of past pictures that are kept.
const KEPT_BYTES: usize = 192 << 20;
/// The most samples that are kept.
const KEPT_SAMPLES: usize = 4096;
/// The most transfers that are kept per body, and the most bodies for which any are kept.
const KEPT_OWNERS: usize = 12;
const KEPT_HISTORIES: usize = 1 << 16;

/// The state that all threads share.
pub(super) struct Hub {
    pub(super) key: String,
    inner: Mutex<Inner>,
    /// Notified when there is something new for viewers.
    news: Condvar,
    /// Notified when viewers want something of the world.
    wish: Condvar,
    /// Says whether pages may pause the world and step it.
    has_controls: AtomicBool,
    viewers: AtomicUsize,
    wanted: AtomicBool,
    closed: AtomicBool,
}

/// The next task of the thread that steps a world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Due {
    /// Take the next step.
    Step,
    /// Go to this tick of a recording.
    Goal(u64),
}

#[derive(Default)]
struct Inner {
    fixed: Option<Hello>,
    control: Control,
    /// The current tick and the goal of a recording that is on its way to a tick.
    going: Option<[u64; 2]>,
    ever_viewed: bool,
    /// What each viewer wishes.
    wishes: BTreeMap<u64, Wishes>,
    frames: VecDeque<Frame>,
    frame_bytes: usize,
    /// Encoded bodies by whether they are fixed and by slot, each with the version of the roster in which it
    /// changed last.
    bodies: BTreeMap<(bool, u32), (u64, Bytes)>,
    roster: u64,
    meshes: Vec<Bytes>,
    joints: (u64, Bytes),
    samples: VecDeque<Sample>,
    /// The number of samples that are no longer kept.
    samples_gone: u64,
    owners: BTreeMap<BodyId, VecDeque<(u64, RegionId, RegionId)>>,
    details: BTreeMap<BodyId, Details>,
    /// The last encoded moment, whose memory the next look uses again.
    memory: Option<Moment>,
}

struct Frame {
    number: u64,
    tick: u64,
    bytes: Bytes,
}

/// What one viewer has been sent.
#[derive(Default)]
pub(super) struct Progress {
    greeted: bool,
    roster: u64,
    meshes: usize,
    joints: u64,
    samples: u64,
    /// The number of the picture that it was sent last.
    frame: u64,
    details: Option<Details>,
}

impl Progress {
    /// Forgets the details that were sent of the chosen body: a page that chooses a body, even the same one
    /// again, has dropped them.
    pub(super) fn forget_chosen(&mut self) {
        self.details = None;
    }
}

/// What a viewer wants to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Want {
    /// A newer picture than it has.
    Newest,
    /// The picture of a past tick, or the nearest before it, or else the oldest.
    Past(u64),
}

impl Hub {
    pub(super) fn new(key: String) -> Self {
        Self {
            key,
            inner: Mutex::default(),
            news: Condvar::new(),
            wish: Condvar::new(),
            has_controls: AtomicBool::new(false),
            viewers: AtomicUsize::new(0),
            wanted: AtomicBool::new(false),
            closed: AtomicBool::new(false),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether there is a viewer.
    pub(super) fn is_viewed(&self) -> bool {
        self.viewers.load(Ordering::Relaxed) > 0
    }

    /// Returns whether a viewer waits for a picture.
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }

    pub(super) fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
        self.news.notify_all();
        self.wish.notify_all();
    }

    pub(super) fn is_closed(&self) -> bool {
        self.closed.load(Ordering::SeqCst)
    }

    /// Adds a viewer; returns `false` if there are [`MOST_VIEWERS`] already.
    pub(super) fn enter(&self, viewer: u64) -> bool {
        let mut inner = self.lock();
        if inner.wishes.len() >= MOST_VIEWERS {
            return false;
        }
        inner.wishes.insert(viewer, Wishes::default());
        inner.ever_viewed = true;
        self.viewers.store(inner.wishes.len(), Ordering::Relaxed);
        self.wish.notify_all();
        true
    }

    /// Removes a viewer. With the last one, all pictures are dropped.
    pub(super) fn leave(&self, viewer: u64) {
        let mut inner = self.lock();
        inner.wishes.remove(&viewer);
        self.viewers.store(inner.wishes.len(), Ordering::Relaxed);
        if inner.wishes.is_empty() {
            inner.frames.clear();
            inner.frame_bytes = 0;
            self.wanted.store(false, Ordering::Relaxed);
        }
    }

    /// Lets pages pause the world and step it.
    pub(super) fn give_controls(&self) {
        self.has_controls.store(true, Ordering::Relaxed);
    }

    /// Returns whether pages may pause the world and step it.
    pub(super) fn has_controls(&self) -> bool {
        self.has_controls.load(Ordering::Relaxed)
    }

    /// Changes the controls as a page asks, if pages have controls: a world that others step goes on whatever
    /// pages ask.
    pub(super) fn control_by_page(&self, change: impl FnOnce(&mut Control)) {
        if self.has_controls() {
            self.control(change);
        }
    }

    pub(super) fn control(&self, change: impl FnOnce(&mut Control)) {
        change(&mut self.lock().control);
        self.wish.notify_all();
    }

    /// Asks a recording to go to a tick, clamped to those on record. Other worlds ignore it.
    pub(super) fn go(&self, tick: u64) {
        let mut inner = self.lock();
        if let Some([first, last]) = inner.fixed.as_ref().and_then(|fixed| fixed.recorded) {
            inner.control.go(tick.clamp(first, last.max(first)));
            self.wish.notify_all();
        }
    }

    /// Takes the tick of a recording to go to, if there is one.
    pub(super) fn take_goal(&self) -> Option<u64> {
        self.lock().control.take_goal()
    }

    /// Sets the current tick and the goal of a recording that is on its way to a tick; `None` if it is not.
    pub(super) fn set_going(&self, going: Option<[u64; 2]>) {
        self.lock().going = going;
    }

    /// Changes what a viewer wishes besides pictures.
    pub(super) fn wish(&self, viewer: u64, change: impl FnOnce(&mut Wishes)) {
        let mut inner = self.lock();
        if let Some(wishes) = inner.wishes.get_mut(&viewer) {
            change(wishes);
        }
        self.wish.notify_all();
    }

    /// Returns the wishes of all viewers together.
    pub(super) fn wishes(&self) -> Wishes {
        let inner = self.lock();
        let mut all = Wishes::default();
        for wishes in inner.wishes.values() {
            all.contacts |= wishes.contacts;
            all.chosen.extend(&wishes.chosen);
        }
        all
    }

    /// Returns what is due now. If nothing is, waits until a step may be due or a viewer wishes for
    /// something, for `longest` at most, and returns `None`.
    pub(super) fn wait_for_step(&self, dt_s: f32, longest: Duration) -> Option<Due> {
        let mut inner = self.lock();
        let until = match inner.ever_viewed.then(|| inner.control.next(Instant::now(), dt_s)) {
            Some(Next::Now) => return Some(Due::Step),
            Some(Next::Goal(tick)) => return Some(Due::Goal(tick)),
            Some(Next::At(due)) => due.saturating_duration_since(Instant::now()).min(longest),
            Some(Next::Asked) | None => longest,
        };
        drop(self.wish.wait_timeout(inner, until));
        None
    }

    /// Returns whether there is a picture to send.
    pub(super) fn has_picture(&self) -> bool {
        !self.lock().frames.is_empty()
    }

    pub(super) fn set_fixed(&self, fixed: Hello) {
        self.lock().fixed = Some(fixed);
    }

    pub(super) fn take_memory(&self) -> Moment {
        self.wanted.store(false, Ordering::Relaxed);
        self.lock().memory.take().unwrap_or_default()
    }

    /// Notes the numbers and the transfers of a tick.
    pub(super) fn note(&self, sample: Sample, handovers: &[Handover]) {
        let mut inner = self.lock();
        inner.samples.push_back(sample);
        if inner.samples.len() > KEPT_SAMPLES {
            inner.samples.pop_front();
            inner.samples_gone += 1;
        }
        for handover in handovers {
            if inner.owners.len() >= KEPT_HISTORIES && !inner.owners.contains_key(&handover.body) {
                continue;
            }
            let owners = inner.owners.entry(handover.body).or_default();
            owners.push_back((sample.tick, handover.from, handover.to));
            if owners.len() > KEPT_OWNERS {
                owners.pop_front();
            }
        }
    }

    /// Encodes a moment and keeps it for viewers.
    pub(super) fn publish(&self, moment: Moment) {
        let Some(origin) = self.lock().fixed.as_ref().map(|fixed| fixed.origin) else { return };
        let frame = Bytes::from(wire::frame(&moment, origin));
        let came: Vec<_> = moment.arrivals.iter().map(|body| wire::body(body, origin)).collect();
        let joints = moment.joints.as_ref().map(|joints| wire::joints(joints));
        let mut inner = self.lock();
        inner.roster += u64::from(!(came.is_empty() && moment.departures.is_empty() && joints.is_none()));
        let version = inner.roster;
        for &(slot, is_fixed) in &moment.departures {
            // A movable body stays known until its slot is given to another: pictures of the past still show
            // it. There are fewer slots than before only when the world went back, and no past is kept.
            if is_fixed || slot >= moment.slot_count {
                let bytes = Bytes::from(wire::gone(slot, is_fixed));
                inner.bodies.insert((is_fixed, slot), (version, bytes));
            }
        }
        for (body, bytes) in moment.arrivals.iter().zip(came) {
            inner.bodies.insert((body.fixed.is_some(), body.slot), (version, Bytes::from(bytes)));
        }
        if let Some(joints) = joints {
            inner.joints = (version, Bytes::from(joints));
        }
        for mesh in &moment.meshes {
            let number = FIRST_MESH + inner.meshes.len() as u16;
            inner.meshes.push(Bytes::from(wire::mesh(number, mesh)));
        }
        if inner.frames.back().is_some_and(|newest| newest.tick > moment.tick) {
            // The world went back.
            inner.frames.clear();
            inner.frame_bytes = 0;
        }
        inner.details = moment.details.iter().map(|details| (details.id, details.clone())).collect();
        inner.frame_bytes += frame.len();
        inner.frames.push_back(Frame { number: moment.number, tick: moment.tick, bytes: frame });
        while inner.frames.len() as u64 > KEPT_FRAMES / 2
            || inner.frame_bytes > KEPT_BYTES && inner.frames.len() > 1
        {
            let gone = inner.frames.pop_front().map_or(0, |frame| frame.bytes.len());
            inner.frame_bytes -= gone;
        }
        inner.memory = Some(moment);
        self.news.notify_all();
    }

    /// Returns the messages that a viewer is sent now. If it wants a newer picture than it has and there is
    /// none, waits for one for at most `longest`.
    pub(super) fn answer(&self, viewer: u64, to: &mut Progress, want: Want, longest: Duration) -> Vec<Bytes> {
        let mut inner = self.lock();
        if want == Want::Newest && inner.frames.back().is_none_or(|frame| frame.number <= to.frame) {
            self.wanted.store(true, Ordering::Relaxed);
            self.wish.notify_all();
            let nothing_new = |inner: &mut Inner| {
                let has_it = inner.frames.back().is_none_or(|frame| frame.number <= to.frame);
                has_it && !self.is_closed()
            };
            let waited = self.news.wait_timeout_while(inner, longest, nothing_new);
            inner = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let mut answer = Vec::new();
        inner.greet(to, &mut answer);
        answer.extend(inner.meshes[to.meshes..].iter().cloned());
        to.meshes = inner.meshes.len();
        if to.roster < inner.roster {
            let newer = inner.bodies.values().filter(|(version, _)| *version > to.roster);
            answer.extend(newer.map(|(_, bytes)| bytes.clone()));
            to.roster = inner.roster;
        }
        if to.joints < inner.joints.0 {
            answer.push(inner.joints.1.clone());
            to.joints = inner.joints.0;
        }
        let skipped = to.samples.saturating_sub(inner.samples_gone) as usize;
        if skipped < inner.samples.len() {
            answer.push(Bytes::from(wire::samples(inner.samples.iter().skip(skipped))));
            to.samples = inner.samples_gone + inner.samples.len() as u64;
        }
        let frame = match want {
            Want::Newest => inner.frames.back().filter(|frame| frame.number > to.frame),
            Want::Past(tick) => {
                let after = inner.frames.partition_point(|frame| frame.tick <= tick);
                inner.frames.get(after.saturating_sub(1)).filter(|frame| frame.number != to.frame)
            }
        };
        if let Some(frame) = frame {
            to.frame = frame.number;
            answer.push(frame.bytes.clone());
        }
        answer.push(Bytes::from(wire::state(&inner.state())));
        if let Some(text) = inner.told_of_chosen(viewer, to) {
            answer.push(Bytes::from(text));
        }
        answer
    }
}

impl Inner {
    fn greet(&self, to: &mut Progress, answer: &mut Vec<Bytes>) {
        if let Some(fixed) = self.fixed.as_ref()
            && !to.greeted
        {
            answer.push(Bytes::from(wire::hello(fixed)));
            to.greeted = true;
        }
    }

    fn state(&self) -> wire::State {
        let tick = |frame: Option<&Frame>| frame.map_or(0, |frame| frame.tick);
        wire::State {
            paused: self.control.is_paused(),
            speed: self.control.speed(),
            kept: [tick(self.frames.front()), tick(self.frames.back())],
            viewers: self.wishes.len(),
            going: self.going,
        }
    }

    /// Returns the details of the body that a viewer has chosen, as JSON; `None` if it has them already.
    fn told_of_chosen(&self, viewer: u64, to: &mut Progress) -> Option<String> {
        let chosen = *self.wishes.get(&viewer)?.chosen.first()?;
        let details = self.details.get(&chosen)?;
        if to.details.as_ref() == Some(details) {
            return None;
        }
        to.details = Some(details.clone());
        let Details { id, epoch, mass_kg, user_data, holders } = details;
        let mass = mass_kg.filter(|mass| mass.is_finite()).map_or("null".into(), |mass| mass.to_string());
        let mut json = format!(
            "{{\"id\":\"{id}\",\"bits\":\"{}\",\"epoch\":{},\"mass_kg\":{mass},\"user_data\":\"{user_data}\",\"holders\":{holders},\
             \"owners\":[",
            id.bits(),
            epoch.0
        );
        let owners = self.owners.get(id).into_iter().flatten().rev().enumerate();
        for (at, (tick, from, to)) in owners {
            let comma = if at > 0 { "," } else { "" };
            // Writing to a string cannot fail.
            let _ = write!(json, "{comma}[{tick},\"{from}\",\"{to}\"]");
        }
        json.push_str("]}");
        Some(json)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::{Arrival, Part};

    /// Makes a moment with these slots, in all of which a body has come.
    fn moment(number: u64, tick: u64, slot_count: u32) -> Moment {
        let part =
            Part { geometry: 0, sensor: false, translation: [0.0; 3], rotation: [0.0; 4], size: [1.0; 3] };
        let arrival = |slot| Arrival {
            slot,
            id: BodyId::persistent(slot),
            kind: 0,
            own: false,
            fixed: None,
            parts: vec![part],
        };
        let arrivals = (0..slot_count).map(arrival).collect();
        Moment { number, tick, slot_count, arrivals, ..Moment::default() }
    }

    #[test]
    fn a_page_is_told_that_slots_are_gone_once_the_world_went_back() {
        let hub = Hub::new("key".to_owned());
        hub.set_fixed(Hello {
            name: String::new(),
            controls: false,
            recorded: None,
            dt_s: 0.1,
            origin: [0.0; 3],
            bounds: [[0.0; 3]; 2],
        });
        assert!(hub.enter(1));
        hub.publish(moment(1, 9, 3));
        hub.publish(Moment { departures: (0..3).map(|slot| (slot, false)).collect(), ..moment(2, 4, 1) });
        let answer = hub.answer(1, &mut Progress::default(), Want::Newest, Duration::ZERO);
        let number = |bytes: &Bytes, at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let bodies = answer.iter().filter(|bytes| bytes[0] == 3);
        let parts: Vec<_> = bodies.map(|bytes| [number(bytes, 4), number(bytes, 16)]).collect();
        assert_eq!(parts, [[0, 1], [1, 0], [2, 0]]);
    }
}
