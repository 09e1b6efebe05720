//! Records the contact and force events of one Rapier world while it steps, by body ids instead of handles.

mod touching;

use std::sync::Mutex;

use rapier3d::geometry::CollisionEventFlags;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::convert;
use crate::protocol::{ColliderRecord, ContactForce, ContactKey, RegionEvents, Touch};
use crate::space::BodyId;
use touching::Touching;

/// The contact listener: Rapier's event handler for one region.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct ContactListener {
    #[serde(skip)]
    heard: Ear,
    /// The names of colliders, by Rapier's collider index.
    names: Vec<Option<Name>>,
    touching: Touching,
    /// Contacts whose bodies left the region since the last step, each with whether one of the two is a sensor.
    lost: Vec<(ContactKey, bool)>,
    /// Colliders already in the region whose force events the user turned on or off since the last step.
    turned: Vec<ColliderHandle>,
}

/// The name of a collider.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Name {
    /// Its body, and its index there.
    of: (BodyId, u16),
    /// The force above which its contacts are reported, newtons; infinite for never.
    threshold_n: f32,
}

/// The events of the present step; empty between steps. Only the stepping thread locks them, but Rapier asks
/// for a handler that can be shared.
#[derive(Default)]
struct Ear(Mutex<Heard>);

impl Clone for Ear {
    fn clone(&self) -> Self {
        Self::default()
    }
}

#[derive(Default)]
struct Heard {
    touches: Vec<RawTouch>,
    forces: Vec<RawForce>,
}

struct RawTouch {
    colliders: [ColliderHandle; 2],
    began: bool,
    sensor: bool,
    point: Vector,
    normal: Vector,
    speed: f32,
}

struct RawForce {
    colliders: [ColliderHandle; 2],
    force: Vector,
    magnitude: f32,
}

impl ContactListener {
    /// Registers a collider that entered the region, or that its user changed. From then on Rapier reports
    /// any force: whether a force is above the user's threshold shows only when the parts of all regions and
    /// all substeps of a tick are added up.
    pub(super) fn name(
        &mut self,
        collider: &mut Collider,
        handle: ColliderHandle,
        of: (BodyId, u16),
        record: &ColliderRecord,
    ) {
        let index = handle.into_raw_parts().0 as usize;
        if self.names.len() <= index {
            self.names.resize(index + 1, None);
        }
        let tells = collider.active_events().contains(ActiveEvents::CONTACT_FORCE_EVENTS);
        let threshold_n = if tells { record.force_event_threshold_n } else { f32::INFINITY };
        collider.set_contact_force_event_threshold(record.force_event_threshold_n.min(0.0));
        let before = self.names[index].replace(Name { of, threshold_n });
        if before.is_some_and(|before| before.threshold_n.is_finite() != threshold_n.is_finite()) {
            self.turned.push(handle);
        }
    }

    /// Ends the contacts of a body that left the region. Rapier would report their end a step later, when its
    /// handles may already belong to another body. Here too the end is reported only after the next step: by
    /// then the region that the body went to has seen these contacts, and the user is not told that they
    /// ceased.
    pub(super) fn forget(&mut self, body: BodyId) {
        self.lost.extend(self.touching.take_of(body, |_| true));
    }

    /// Ends the contacts of a collider whose user no longer wants to hear of them, since Rapier will not
    /// report their end. Contacts of which the other collider still `tells` go on.
    pub(super) fn mute(&mut self, of: (BodyId, u16), tells: impl Fn((BodyId, u16)) -> bool) {
        let ended = self.touching.take_of(of.0, |key| {
            let ends = [(key.a, key.collider_a), (key.b, key.collider_b)];
            ends.contains(&of) && !ends.into_iter().any(|end| end != of && tells(end))
        });
        self.lost.extend(ended);
    }

    /// Makes Rapier look again, in the next step, at colliders whose force events were turned on or off. Must
    /// be called after the step that follows [`ContactListener::name`]. Rapier 0.36 overlooks a contact whose
    /// forces were turned on, for as long as it rests, if another contact ended in the same step: Rapier
    /// keeps contacts by place, and the last one moves to where one ended.
    pub(super) fn remind(&mut self, colliders: &mut ColliderSet) {
        for handle in self.turned.drain(..) {
            colliders.get_mut(handle);
        }
    }

    /// Returns whether contacts ended since the last step because their bodies left the region.
    pub(super) fn owes_word(&self) -> bool {
        !self.lost.is_empty()
    }

    /// Appends everything recorded since the last call to `events`, by body ids. Forces count for the part
    /// `part` of a tick.
    pub(super) fn drain(&mut self, anchor: [f64; 3], part: f32, events: &mut RegionEvents) {
        events.touches.extend(self.lost.drain(..).map(|(key, sensor)| end_of(key, sensor)));
        let heard = std::mem::take(self.heard.0.get_mut().expect("a region steps on one thread at a time"));
        for raw in heard.touches {
            let Some((key, swapped)) = self.key(raw.colliders) else { continue };
            if raw.began {
                self.touching.insert(key, raw.sensor);
                let normal = if swapped { -raw.normal } else { raw.normal };
                events.touches.push(Touch {
                    key,
                    began: true,
                    sensor: raw.sensor,
                    point: convert::world_point(anchor, raw.point),
                    normal: normal.to_array(),
                    speed: raw.speed,
                });
            } else if self.touching.remove(key) {
                events.touches.push(end_of(key, raw.sensor));
            }
        }
        for raw in heard.forces {
            let Some((key, swapped)) = self.key(raw.colliders) else { continue };
            let force = if swapped { -raw.force } else { raw.force };
            events.forces.push(ContactForce {
                key,
                force_n: (force * part).to_array(),
                magnitude_n: raw.magnitude * part,
                threshold_n: raw
                    .colliders
                    .map(|collider| self.threshold_n(collider))
                    .into_iter()
                    .fold(f32::MAX, f32::min),
            });
        }
    }

    /// Returns the body of a collider, and its index there.
    pub(super) fn name_of(&self, handle: ColliderHandle) -> Option<(BodyId, u16)> {
        Some(self.names.get(handle.into_raw_parts().0 as usize)?.as_ref()?.of)
    }

    fn threshold_n(&self, collider: ColliderHandle) -> f32 {
        let name = self.names.get(collider.into_raw_parts().0 as usize).copied().flatten();
        name.map_or(f32::INFINITY, |name| name.threshold_n)
    }

    fn key(&self, colliders: [ColliderHandle; 2]) -> Option<(ContactKey, bool)> {
        let name = |handle: ColliderHandle| *self.names.get(handle.into_raw_parts().0 as usize)?;
        let (first, second) = (name(colliders[0])?.of, name(colliders[1])?.of);
        let swapped = second < first;
        let (low, high) = if swapped { (second, first) } else { (first, second) };
        Some((ContactKey { a: low.0, b: high.0, collider_a: low.1, collider_b: high.1 }, swapped))
    }
}

/// A listener for a step that is thrown away: it hears which contacts begin and end, and nothing of their
/// forces.
pub(super) struct TouchListener<'a>(pub &'a ContactListener);

impl EventHandler for TouchListener<'_> {
    fn handle_collision_event(
        &self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        event: CollisionEvent,
        pair: Option<&ContactPair>,
    ) {
        self.0.handle_collision_event(bodies, colliders, event, pair);
    }

    fn handle_contact_force_event(
        &self,
        _dt: Real,
        _bodies: &RigidBodySet,
        _colliders: &ColliderSet,
        _pair: &ContactPair,
        _magnitude: Real,
    ) {
    }

    fn handle_soft_body_tear_event(&self, _soft_bodies: &SoftBodySet, _event: &SoftBodyTearEvent) {}
}

fn end_of(key: ContactKey, sensor: bool) -> Touch {
    Touch { key, began: false, sensor, point: [0.0; 3], normal: [0.0; 3], speed: 0.0 }
}

impl EventHandler for ContactListener {
    fn handle_collision_event(
        &self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        event: CollisionEvent,
        pair: Option<&ContactPair>,
    ) {
        let (first, second, flags) = match event {
            CollisionEvent::Started(a, b, flags) | CollisionEvent::Stopped(a, b, flags) => (a, b, flags),
        };
        // `forget` has reported this end already. Rapier also reports disabled colliders as removed, but
        // these still exist.
        let is_gone = |collider| colliders.get(collider).is_none();
        if flags.contains(CollisionEventFlags::REMOVED) && (is_gone(first) || is_gone(second)) {
            return;
        }
        let mut touch = RawTouch {
            colliders: [first, second],
            began: event.started(),
            sensor: flags.contains(CollisionEventFlags::SENSOR),
            point: Vector::ZERO,
            normal: Vector::ZERO,
            speed: 0.0,
        };
        if touch.began
            && let (Some(a), Some(b)) = (colliders.get(first), colliders.get(second))
        {
            touch.point = (a.translation() + b.translation()) * 0.5;
            if let Some((manifold, contact)) = pair.and_then(ContactPair::find_deepest_contact) {
                let on = manifold.subshape_pos1().map_or(*a.position(), |sub| *a.position() * sub);
                touch.point = on * contact.local_p1;
                touch.normal = manifold.data.normal;
                let velocity = |collider: &Collider| {
                    let body = collider.parent().and_then(|parent| bodies.get(parent));
                    body.map_or(Vector::ZERO, |body| body.velocity_at_point(touch.point))
                };
                touch.speed = (velocity(a) - velocity(b)).dot(touch.normal).max(0.0);
            }
        }
        self.heard.0.lock().expect("no thread panics while it holds the lock").touches.push(touch);
    }

    fn handle_contact_force_event(
        &self,
        dt: Real,
        _bodies: &RigidBodySet,
        _colliders: &ColliderSet,
        pair: &ContactPair,
        magnitude: Real,
    ) {
        let force = RawForce {
            colliders: [pair.collider1, pair.collider2],
            force: pair.total_impulse() / dt,
            magnitude,
        };
        self.heard.0.lock().expect("no thread panics while it holds the lock").forces.push(force);
    }

    fn handle_soft_body_tear_event(&self, _soft_bodies: &SoftBodySet, _event: &SoftBodyTearEvent) {}
}
