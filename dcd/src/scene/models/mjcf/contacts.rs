//! Decides which geoms may touch, by MuJoCo's rules.

use std::collections::BTreeSet;

use rapier3d::prelude::*;
use rapier3d_mjcf::MjcfRobot;
use rapier3d_mjcf::mjcf_rs::{self as mjcf, body::Geom};

use crate::scene::models::model::MAX_PAIRS;
use crate::scene::models::source::Fault;
use crate::scene::models::warnings::Warnings;

/// Gives a collider the geom's friction and groups. Two geoms touch if the type of either is among the
/// affinities of the other. The larger friction of the two counts.
pub(super) fn touch(collider: ColliderBuilder, geom: &Geom, contact: bool) -> ColliderBuilder {
    let [types, affinities] = if contact { [geom.contype, geom.conaffinity] } else { [0, 0] };
    let groups = InteractionGroups::new(
        Group::from_bits_retain(types),
        Group::from_bits_retain(affinities),
        InteractionTestMode::Or,
    );
    let friction = if geom.condim == 1 { 0.0 } else { geom.friction[0] as f32 };
    collider.collision_groups(groups).friction(friction).friction_combine_rule(CoefficientCombineRule::Max)
}

/// Returns the pairs of the loader's bodies that never touch: those welded together, with `filter_parent`
/// those tied by a joint (but not to the world), and those excluded.
pub(super) fn apart(
    robot: &MjcfRobot,
    file: &mjcf::Model,
    filter_parent: bool,
) -> Result<BTreeSet<(usize, usize)>, Fault> {
    // For each body, the body to which it is finally welded, and the parent of that, resolved likewise; the
    // world is 0.
    let mut weld = vec![0; file.bodies.len()];
    let mut parent = vec![0; file.bodies.len()];
    for (index, entry) in file.bodies.iter().enumerate().skip(1) {
        let above = entry.parent.unwrap_or(0);
        (weld[index], parent[index]) =
            if entry.body.joints.is_empty() { (weld[above], parent[above]) } else { (index, weld[above]) };
    }
    let mut leaves = vec![0; file.bodies.len()];
    for (index, made) in robot.bodies.iter().enumerate().rev().filter(|(_, made)| !made.is_intermediate) {
        leaves[made.mjcf_body_id] = index;
    }
    let mut pairs = BTreeSet::new();
    for a in 0..file.bodies.len() {
        if pairs.len() > MAX_PAIRS {
            let cause = format!("more than {MAX_PAIRS} pairs of bodies are one piece, or tied by a joint");
            return Err(Fault::new(cause, "join what is welded together into one body"));
        }
        for b in a + 1..file.bodies.len() {
            let welded = weld[a] == weld[b] && weld[a] != 0;
            let related = parent[a] == weld[b] && weld[b] != 0 || parent[b] == weld[a] && weld[a] != 0;
            if welded || filter_parent && related {
                pairs.insert((leaves[a].min(leaves[b]), leaves[a].max(leaves[b])));
            }
        }
    }
    let named = |name: &str| match name {
        "world" => Some(0),
        name => file.body_id_by_name(name).map(|body| leaves[body]),
    };
    for exclude in &file.contact.excludes {
        let (Some(a), Some(b)) = (named(&exclude.body1), named(&exclude.body2)) else {
            let cause =
                format!("<exclude> of {} and {}: one of them is not there", exclude.body1, exclude.body2);
            return Err(Fault::new(cause, "correct the names"));
        };
        if a != b {
            pairs.insert((a.min(b), a.max(b)));
        }
    }
    Ok(pairs)
}

/// Warns of properties of contacts that MuJoCo has and dcd does not.
pub(super) fn warn(file: &mjcf::Model, warnings: &mut Warnings) {
    for pair in &file.contact.pairs {
        let names = format!("{} with {}", pair.geom1, pair.geom2);
        warnings.add(
            "contact pair",
            names,
            "has no effect: contype, conaffinity and the geoms' friction count",
        );
    }
    for (entry, geom) in
        file.bodies.iter().flat_map(|entry| entry.body.geoms.iter().map(move |geom| (entry, geom)))
    {
        if geom.condim > 3 && (geom.contype != 0 || geom.conaffinity != 0) {
            let of = geom.name.as_ref().or(entry.body.name.as_ref()).map_or("the world", |name| name);
            warnings.add(
                "rolling and torsional friction (condim 4 and 6)",
                of,
                "geoms only slide with friction",
            );
        }
    }
}
