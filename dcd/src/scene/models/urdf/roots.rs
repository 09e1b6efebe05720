//! Takes empty roots out of a robot. They are frames that say where the robot stands. The loader would fix
//! them to the world and forget where.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;
use rapier3d_urdf::urdf_rs::{self, JointType};

/// The name of a root that is the world itself, by custom.
pub(super) const WORLD: &str = "world";

/// The roots that are left, with the poses at which they begin.
#[derive(Default)]
pub(super) struct Roots {
    poses: BTreeMap<String, Pose>,
    /// The roots that were welded to the world.
    pub(super) fixed: BTreeSet<String>,
}

impl Roots {
    /// Takes the empty roots out, with the joints that weld other links to them. An empty root that also has
    /// joints which move stays, as a part of the world.
    pub(super) fn take(robot: &mut urdf_rs::Robot) -> Self {
        let mut roots = Self::default();
        let mut below: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (index, joint) in robot.joints.iter().enumerate() {
            below.entry(&joint.parent.link).or_default().push(index);
        }
        let tied: BTreeSet<_> = robot.joints.iter().map(|joint| &joint.child.link).collect();
        let empty: BTreeSet<_> =
            robot.links.iter().filter(|link| is_empty(link)).map(|link| link.name.as_str()).collect();
        let begin = robot.links.iter().filter(|link| !tied.contains(&link.name));
        let mut left: Vec<_> = begin.map(|link| (link.name.as_str(), Pose::IDENTITY, false)).collect();
        let (mut links, mut welds) = (BTreeSet::new(), BTreeSet::new());
        while let Some((root, pose, is_fixed)) = left.pop() {
            let own = below.get(root).into_iter().flatten().copied();
            let (welded, moving): (Vec<_>, Vec<_>) =
                own.partition(|&index| robot.joints[index].joint_type == JointType::Fixed);
            let is_taken = empty.contains(root) && !welded.is_empty();
            if !is_taken || !moving.is_empty() {
                roots.poses.insert(root.to_owned(), pose);
                roots.fixed.extend(is_fixed.then(|| root.to_owned()));
            } else {
                links.insert(root.to_owned());
            }
            if is_taken {
                let is_fixed = is_fixed || root == WORLD || !moving.is_empty();
                let joints = welded.iter().map(|&index| &robot.joints[index]);
                left.extend(
                    joints.map(|joint| (joint.child.link.as_str(), pose * pose_of(&joint.origin), is_fixed)),
                );
                welds.extend(welded);
            }
        }
        let mut index = 0..;
        robot.joints.retain(|_| index.next().is_none_or(|index| !welds.contains(&index)));
        robot.links.retain(|link| !links.contains(&link.name));
        roots
    }

    /// Returns, by link, the pose at which the root begins to which the link belongs.
    pub(super) fn of_links(&self, robot: &urdf_rs::Robot) -> BTreeMap<String, Pose> {
        let mut below: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for joint in &robot.joints {
            below.entry(&joint.parent.link).or_default().push(&joint.child.link);
        }
        let mut found = BTreeMap::new();
        let mut left: Vec<_> = self.poses.iter().map(|(link, pose)| (link.as_str(), *pose)).collect();
        while let Some((link, pose)) = left.pop() {
            found.insert(link.to_owned(), pose);
            left.extend(below.get(link).into_iter().flatten().map(|&child| (child, pose)));
        }
        found
    }
}

/// Returns whether a link has neither looks, shapes nor mass.
fn is_empty(link: &urdf_rs::Link) -> bool {
    let urdf_rs::Inertia { ixx, ixy, ixz, iyy, iyz, izz } = &link.inertial.inertia;
    let weight = [&link.inertial.mass.value, ixx, ixy, ixz, iyy, iyz, izz];
    link.visual.is_empty() && link.collision.is_empty() && weight.into_iter().all(|value| *value == 0.0)
}

fn pose_of(origin: &urdf_rs::Pose) -> Pose {
    Pose::from_parts(Vector::from(origin.xyz.0.map(|v| v as f32)), super::turn(origin))
}
