//! Makes one body of the links that fixed joints tie to each other, where they differ much in mass: an impulse
//! joint would hold them badly. Robots of ROS have a base of little or no mass, and a fixed joint to the link
//! that has the mass of both. Links of like mass stay bodies, and so do links that are tied to something fixed,
//! which are fixed too.

use rapier3d::prelude::*;

use crate::scene::models::mass::Mass;
use crate::scene::models::model::{Model, Part, is_weld};
use crate::scene::models::weights::give_inertia;

/// The ratio of masses up to which an impulse joint holds two links together.
const HELD_RATIO: f32 = 10.0;

/// The groups of links that fixed joints tie to each other.
pub(super) struct Welds {
    /// The topmost link of the group that each link belongs to: a link without others is its own.
    tops: Vec<usize>,
}

impl Welds {
    /// Finds the groups of a model whose joints form a tree.
    pub(super) fn of(model: &Model) -> Self {
        let mut tops: Vec<usize> = (0..model.parts.len()).collect();
        for joint in model.joints.iter().filter(|joint| is_weld(&joint.joint)) {
            tops[joint.b] = joint.a;
        }
        for part in 0..tops.len() {
            while tops[tops[part]] != tops[part] {
                tops[part] = tops[tops[part]];
            }
        }
        Self { tops }
    }

    /// Returns for each link whether this is true of any link of its group.
    pub(super) fn any(&self, model: &Model, is_true: impl Fn(&Part) -> bool) -> Vec<bool> {
        let mut of_tops = vec![false; self.tops.len()];
        for (part, &top) in model.parts.iter().zip(&self.tops) {
            of_tops[top] |= is_true(part);
        }
        self.tops.iter().map(|&top| of_tops[top]).collect()
    }

    /// Makes a body of each group that can move and whose links differ much in mass: the topmost link, with the
    /// masses, inertias, shapes and joints of all. The pairs that never touch must not be known yet.
    pub(super) fn merge(mut self, model: &mut Model) {
        assert!(model.apart.is_empty(), "pairs are numbered by bodies");
        let fixed = self.any(model, Part::is_fixed);
        let mut heaviest_kg = vec![0.0_f32; self.tops.len()];
        for (part, &top) in model.parts.iter().zip(&self.tops) {
            heaviest_kg[top] = heaviest_kg[top].max(part.mass.mass());
        }
        let mut differ = vec![false; self.tops.len()];
        for (part, &top) in model.parts.iter().zip(&self.tops) {
            differ[top] |= HELD_RATIO * part.mass.mass() < heaviest_kg[top];
        }
        for (part, top) in self.tops.iter_mut().enumerate() {
            if fixed[part] || !differ[*top] {
                *top = part;
            }
        }
        let tops = self.tops;
        let Model { parts, joints, warnings, .. } = model;
        let mut top_from_link = vec![Pose::IDENTITY; parts.len()];
        for (link, &top) in tops.iter().enumerate().filter(|(link, top)| link != *top) {
            for part in [top, link] {
                if parts[part].mass.inv_mass > 0.0 {
                    give_inertia(&mut parts[part], warnings);
                }
            }
            let pose = parts[top].pose.inverse() * parts[link].pose;
            let (mass, colliders) = (parts[link].mass, std::mem::take(&mut parts[link].colliders));
            let body = &mut parts[top];
            // Without mass there is no inertia, whatever the file says.
            body.mass = match (body.mass.inv_mass > 0.0, mass.inv_mass > 0.0) {
                (true, true) => (Mass::of(&body.mass) + Mass::of(&mass).placed(&pose)).properties(),
                (false, true) => mass.transform_by(&pose),
                (_, false) => body.mass,
            };
            let placed = |from: ColliderBuilder| ColliderBuilder { position: pose * from.position, ..from };
            body.colliders.extend(colliders.into_iter().map(placed));
            top_from_link[link] = pose;
        }
        let stays = |link: usize| tops[link] == link;
        // By link: the number of bodies before it.
        let places: Vec<usize> = (0..tops.len())
            .scan(0, |before, link| {
                let place = *before;
                *before += usize::from(stays(link));
                Some(place)
            })
            .collect();
        joints.retain(|joint| tops[joint.a] != tops[joint.b]);
        for joint in joints {
            // The end below is no link that went: the one joint above such a link was a fixed one.
            if !stays(joint.a) {
                joint.joint.local_frame1 = top_from_link[joint.a] * joint.joint.local_frame1;
            }
            (joint.a, joint.b) = (places[tops[joint.a]], places[joint.b]);
        }
        let mut link = 0..;
        parts.retain(|_| link.next().is_some_and(stays));
    }
}
