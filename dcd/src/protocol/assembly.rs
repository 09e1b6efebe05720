//! Groups new bodies into assemblies, which are sent together: bodies that joints tie, with their shapes.

use std::collections::{BTreeMap, BTreeSet};

use super::{BodyKind, BodyRecord, JointRecord, ShapeHash, ShapeRecord, encoded_len, most_items};
use crate::space::{BodyId, Groups};

/// New bodies that are sent together, with the shapes that no receiver has yet.
#[derive(Clone, Debug, Default)]
pub(crate) struct Assembly {
    pub bodies: Vec<BodyRecord>,
    pub shapes: Vec<ShapeRecord>,
    pub joints: Vec<JointRecord>,
}

impl Assembly {
    fn len(&self) -> usize {
        encoded_len(&self.bodies) + encoded_len(&self.shapes) + encoded_len(&self.joints)
    }

    /// Returns whether it takes at most `bytes` bytes, and its reader has room for it.
    pub(crate) fn fits(&self, bytes: usize) -> bool {
        let (bodies, joints) = (most_items::<BodyRecord>(), most_items::<JointRecord>());
        self.len() <= bytes && self.bodies.len() <= bodies && self.joints.len() <= joints
    }

    fn append(&mut self, other: Self) {
        self.bodies.extend(other.bodies);
        for shape in other.shapes {
            if !self.shapes.contains(&shape) {
                self.shapes.push(shape);
            }
        }
        self.joints.extend(other.joints);
    }
}

/// Returns the assemblies of new bodies: first the fixed bodies, one by one. Each assembly has all of these
/// shapes that it uses, parts before compounds: if one is refused, the next must not lack its shapes.
pub(crate) fn assemblies(
    bodies: &[BodyRecord],
    shapes: &[ShapeRecord],
    joints: &[JointRecord],
) -> Vec<Assembly> {
    let new: BTreeMap<BodyId, BodyKind> = bodies.iter().map(|body| (body.id, body.traits.kind)).collect();
    let is_movable = |id: &BodyId| new.get(id).is_some_and(|kind| *kind != BodyKind::Fixed);
    let mut tied = Groups::default();
    for joint in joints.iter().filter(|joint| is_movable(&joint.a) && is_movable(&joint.b)) {
        tied.join(joint.a, joint.b);
    }
    let mut found: BTreeMap<(bool, BodyId), Assembly> = BTreeMap::new();
    for body in bodies {
        let key = (is_movable(&body.id), tied.root(body.id));
        found.entry(key).or_default().bodies.push(body.clone());
    }
    for joint in joints {
        let movable = if is_movable(&joint.a) { joint.a } else { joint.b };
        found.entry((true, tied.root(movable))).or_default().joints.push(joint.clone());
    }
    let places: BTreeMap<_, _> = shapes.iter().enumerate().map(|(at, shape)| (shape.hash(), at)).collect();
    for assembly in found.values_mut().filter(|_| !shapes.is_empty()) {
        let colliders = assembly.bodies.iter().flat_map(|body| &body.traits.colliders);
        let mut own: BTreeSet<_> =
            colliders.filter_map(|collider| places.get(&collider.shape)).copied().collect();
        let parts = own.iter().flat_map(|&at| shapes[at].parts());
        own.extend(parts.filter_map(|part| places.get(&part)).copied().collect::<Vec<_>>());
        assembly.shapes = own.into_iter().map(|at| shapes[at].clone()).collect();
    }
    found.into_values().collect()
}

/// Joins assemblies, in order, into parts of at most `bytes` bytes each. An assembly that is longer is a part
/// of its own.
pub(crate) fn gathered(assemblies: Vec<Assembly>, bytes: usize) -> Vec<Assembly> {
    let mut parts: Vec<Assembly> = Vec::new();
    let mut room = 0;
    for assembly in assemblies {
        let len = assembly.len();
        match parts.last_mut() {
            Some(part) if len <= room => part.append(assembly),
            _ => {
                parts.push(assembly);
                room = bytes;
            }
        }
        room = room.saturating_sub(len);
    }
    parts
}

/// Removes the shapes of a body from `left` and returns them, parts before compounds.
pub(crate) fn take_shapes_of(
    body: &BodyRecord,
    left: &mut BTreeMap<ShapeHash, ShapeRecord>,
) -> Vec<ShapeRecord> {
    let mut own = Vec::new();
    for collider in &body.traits.colliders {
        let Some(shape) = left.remove(&collider.shape) else { continue };
        own.extend(shape.parts().filter_map(|part| left.remove(&part)));
        own.push(shape);
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Pose;
    use crate::sim::{sim_body, sim_collider};

    #[test]
    fn parts_hold_whole_assemblies_and_lose_nothing() {
        let bodies: Vec<_> =
            (0..12).map(|i| sim_body(BodyId::persistent(i), [f64::from(i), 0.0, 0.0])).collect();
        let alone = encoded_len(&bodies[..1].to_vec());
        let parts = gathered(assemblies(&bodies, &[], &[]), 4 * alone);
        assert!(parts.len() > 2 && parts.iter().all(|part| part.len() <= 4 * alone + 8), "{}", parts.len());
        let ids: Vec<_> = parts.iter().flat_map(|part| part.bodies.iter().map(|body| body.id)).collect();
        assert!(ids.iter().copied().eq(bodies.iter().map(|body| body.id)));
    }

    #[test]
    fn each_part_has_all_its_shapes_and_each_once() {
        let at = Pose { translation: [1.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
        let ball = ShapeRecord::Ball(0.5);
        let pair = ShapeRecord::Compound(vec![(at, ball.hash()), (at, ball.hash())]);
        let shapes = [ball, pair.clone(), ShapeRecord::Ball(0.25)];
        let body = |i| {
            let mut body = sim_body(BodyId::persistent(i), [f64::from(i), 0.0, 0.0]);
            std::sync::Arc::make_mut(&mut body.traits).colliders = vec![sim_collider(&pair)];
            body
        };
        let bodies: Vec<_> = (0..4).map(body).collect();
        for bytes in [0, 1 << 20] {
            let parts = gathered(assemblies(&bodies, &shapes, &[]), bytes);
            assert_eq!(parts.len(), if bytes == 0 { 4 } else { 1 });
            assert!(parts.iter().all(|part| part.shapes == shapes[..2]), "{parts:?}");
        }
    }
}
