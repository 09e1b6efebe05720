//! Inserts bodies, joints and regions into a host and removes them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rapier3d::prelude::IntegrationParameters;

use super::{HostError, RegionHost, StepSettings, threads};
use crate::physics::coupling::Side;
use crate::physics::owner_index::Home;
use crate::physics::placement::{self, Placement, movable_ends};
use crate::physics::region::{Ownership, Region, better_anchor};
use crate::physics::shapes::{ShapeError, ShapeLibrary};
use crate::physics::statics::Statics;
use crate::physics::{articulation, convert, joints};
use crate::protocol::{BodyKind, BodyRecord, BodyTraits, JointRecord, ShapeHash, Vehicle, WorldPose};
use crate::space::{BodyId, JointId, RegionId, RegionSet, Tick};

/// The reason why no kinematic body carries a multibody. Seen with Rapier 0.36.1: what is put on such a root
/// falls through it.
pub(super) const KINEMATIC_ROOT: &str = "its first body is kinematic, which Rapier neither moves nor lets anything touch in a multibody; \
     tie a dynamic first body to the kinematic one by an impulse joint";

impl RegionHost {
    /// Adds an empty region.
    pub(super) fn add_region(&mut self, id: RegionId) {
        let rank = self.partition.rank_of(id).expect("a region is a leaf of the tree");
        assert!(self.place_of[rank].is_none(), "{id} is hosted here already");
        let part = self.partition.tree().part(id);
        let cell = *self.partition.cell(rank);
        let StepSettings { gravity, coupling, exchanges, .. } = self.settings;
        let steps = coupling.first_steps(exchanges);
        let mut region = Region::new(id, rank, cell, &part, gravity);
        region.set_hooks(self.hooks.clone());
        let place = self.sides.partition_point(|other| other.region.rank() < rank);
        self.sides.insert(place, Side::new(region, self.partition.leaves(), steps));
        self.index();
    }

    /// Inserts bodies and the joints among them into the regions where they belong, as far as these are
    /// computed here. A small group of tied bodies goes to the region where most of it lies, a multibody to
    /// that of its lowest body, an immovable body wherever it reaches. Ghosts come with the exchange after
    /// [`RegionHost::announce`]. [`RegionHost::step`] sees to that before it steps, once for all that was
    /// inserted. If anything is refused, nothing is inserted.
    pub fn insert(&mut self, mut bodies: Vec<BodyRecord>, joints: &[JointRecord]) -> Result<(), HostError> {
        // Nobody has found contacts of new bodies yet, whatever their records say.
        bodies.iter_mut().for_each(|body| body.state.contact_offset = None);
        self.insert_saved(bodies, joints)
    }

    /// Inserts bodies and joints in the same way, but from records of a saved world. Bodies that come into a
    /// region in which nothing else moves find their contacts as they lay when these were found elsewhere.
    pub(crate) fn insert_saved(
        &mut self,
        mut bodies: Vec<BodyRecord>,
        joints: &[JointRecord],
    ) -> Result<(), HostError> {
        if !bodies.is_empty() {
            self.meet_all();
        }
        bodies.sort_by_key(|body| body.id);
        if let Some(taken) = bodies.iter().find(|body| self.held(body.id)) {
            return Err(HostError::Taken(taken.id));
        }
        self.check(&bodies, joints)?;
        // A saved world knows only of some bodies how they lay.
        if bodies.iter().any(placement::lies) {
            placement::note_standing(&mut bodies, joints);
        }
        self.insert_checked(bodies, joints)
    }

    /// Removes bodies and inserts them anew from these records, with all of their joints. If anything is
    /// refused, nothing is removed.
    pub(super) fn reinsert(
        &mut self,
        mut bodies: Vec<BodyRecord>,
        joints: &[JointRecord],
    ) -> Result<(), HostError> {
        self.meet_all();
        bodies.sort_by_key(|body| body.id);
        self.check(&bodies, joints)?;
        let targets = self.targets_of(&bodies);
        for body in &bodies {
            self.remove(body.id);
        }
        self.insert_checked(bodies, joints)?;
        self.send_all(targets)
    }

    /// Inserts one body that no joint ties, as [`RegionHost::insert`] would.
    pub(crate) fn insert_one(&mut self, body: BodyRecord) -> Result<(), HostError> {
        self.meet_all();
        if self.held(body.id) {
            return Err(HostError::Taken(body.id));
        }
        // The insertion itself finds out whether its shapes are known.
        check_state(&body)?;
        self.insert_alone(body)
    }

    fn insert_checked(
        &mut self,
        mut bodies: Vec<BodyRecord>,
        joints: &[JointRecord],
    ) -> Result<(), HostError> {
        if joints.is_empty()
            && bodies.len() == 1
            && let Some(body) = bodies.pop()
        {
            // Many bodies come one by one, and are spared the cost of a list.
            return self.insert_alone(body);
        }
        let placement = Placement::of(&bodies, joints, &self.shapes, &self.settings)?;
        let owners = placement.owners(&bodies, &self.partition);
        // A scene comes at once, so its bodies touch only one another.
        let scene = self.tick == Tick(0) && bodies.len() > 1;
        let whole = if scene { placement.whole(&bodies, &owners) } else { vec![false; bodies.len()] };
        let is_all = scene && self.owned_count() == 0;
        self.insert_placed(bodies, &owners, &whole, joints)?;
        self.is_placed = is_all;
        Ok(())
    }

    /// Returns where kinematic bodies go in the next step, for those that are where these records say. A
    /// record holds no target.
    pub(super) fn targets_of(&self, bodies: &[BodyRecord]) -> Vec<(BodyId, WorldPose)> {
        // A body that is put elsewhere does not go on to its target.
        let stays = |body: &&BodyRecord| {
            body.traits.kind == BodyKind::KinematicPosition
                && self.record(body.id).is_some_and(|known| known.state.pose == body.state.pose)
        };
        bodies.iter().filter(stays).filter_map(|body| Some((body.id, self.target_of(body.id)?))).collect()
    }

    pub(super) fn send_all(&mut self, targets: Vec<(BodyId, WorldPose)>) -> Result<(), HostError> {
        targets.into_iter().try_for_each(|(id, target)| self.send_to(id, target).map(drop))
    }

    /// Removes a body from every region. Returns whether any held it.
    pub fn remove(&mut self, id: BodyId) -> bool {
        self.is_placed = false;
        let places = self.places_of(id);
        let mut held = self.statics.remove(id);
        for place in places {
            held |= self.sides[place].region.take_away(id);
        }
        // Joints may wait for it in regions that never held it.
        for Side { region, .. } in &mut self.sides {
            region.forget_ties(id);
        }
        self.owner_index.remove(id);
        held
    }

    /// Forgets the shapes that no body has any more, now and then. Otherwise dug terrain and debris would
    /// fill memory, checkpoints and saves. This is done only where all regions are computed here: then no
    /// message names a shape that no body has.
    pub(crate) fn forget_unused_shapes(&mut self) {
        if !self.shapes.has_grown(self.owned_count()) || self.sides.len() != self.partition.len() {
            return;
        }
        let used = self.used_shapes();
        self.shapes.keep(used);
    }

    /// Forgets those of these shapes that no body here has.
    pub(crate) fn forget_shapes(&mut self, gone: &BTreeSet<ShapeHash>) {
        if !gone.is_empty() {
            let used = self.used_shapes();
            self.shapes.forget(gone, used);
        }
    }

    fn used_shapes(&self) -> BTreeSet<ShapeHash> {
        let held = self.regions().flat_map(Region::all_traits);
        let all = held.chain(self.statics.bodies().map(|body| &*body.traits));
        all.flat_map(|traits| &traits.colliders).map(|collider| collider.shape).collect()
    }

    /// Inserts a joint between two bodies of the world, and wakes them. Their assemblies become one. If these
    /// lie in different regions, both are placed anew, which costs them the warm start of one step.
    pub fn tie(&mut self, joint: JointRecord) -> Result<(), HostError> {
        let JointRecord { id, a, b, .. } = joint;
        if a == b {
            return Err(HostError::Itself { joint: id, body: a });
        }
        self.check_links(std::slice::from_ref(&joint), &[])?;
        if self.partition.len() == 1 {
            self.insert(Vec::new(), &[joint])?;
        } else {
            self.tie_over_regions(joint)?;
        }
        // As Rapier's world does. Bodies that come with their joints may go on sleeping.
        for end in [a, b].into_iter().filter(|&end| self.statics.body(end).is_none()).collect::<Vec<_>>() {
            self.change_copies(end, |body| body.wake_up(true));
        }
        Ok(())
    }

    /// Inserts a joint between bodies whose assemblies may lie in different regions.
    fn tie_over_regions(&mut self, joint: JointRecord) -> Result<(), HostError> {
        let (mut bodies, mut ties) = (BTreeMap::new(), BTreeMap::new());
        for body in [joint.a, joint.b] {
            self.gather_assembly(body, &mut bodies, &mut ties);
        }
        let places: Vec<_> = bodies.keys().map(|&body| self.present_place(body)).collect();
        let linked = joint.link.is_some() || ties.values().any(|joint| joint.link.is_some());
        let shared = places.iter().any(|(_, holders)| !holders.is_empty());
        if places.windows(2).all(|pair| pair[0] == pair[1]) && !(linked && shared) {
            return self.insert(Vec::new(), &[joint]);
        }
        ties.insert(joint.id, joint);
        self.reinsert(bodies.into_values().collect(), &ties.into_values().collect::<Vec<_>>())
    }

    /// Checks that Rapier can have these joints in multibodies, beside the present joints that tie none of
    /// these bodies.
    fn check_links(&self, joints: &[JointRecord], bodies: &[BodyRecord]) -> Result<(), HostError> {
        let mut parents = BTreeMap::new();
        for joint in joints.iter().filter(|joint| joint.link.is_some()) {
            let fault = |cause| HostError::MultibodyJoint { joint: joint.id, body: joint.b, cause };
            if let Some(cause) = articulation::link_fault(&joints::joint_of(joint)) {
                return Err(fault(cause));
            }
            let kind_of = |id: BodyId| match bodies.binary_search_by_key(&id, |body| body.id) {
                Ok(place) => Some(bodies[place].traits.kind),
                Err(_) => self.traits(id).map(|traits| traits.kind),
            };
            if kind_of(joint.b).is_some_and(|kind| kind != BodyKind::Dynamic) {
                return Err(fault("only a dynamic body can be the second one; tie it the other way round"));
            }
            if kind_of(joint.a).is_some_and(|kind| !matches!(kind, BodyKind::Dynamic | BodyKind::Fixed)) {
                return Err(fault(KINEMATIC_ROOT));
            }
            if self.parent_of(joint.b, bodies).is_some() || parents.insert(joint.b, joint.a).is_some() {
                return Err(fault("it is a link of a multibody already; close loops with impulse joints"));
            }
            let mut above = Some(joint.a);
            while let Some(id) = above {
                if id == joint.b {
                    return Err(fault("the joint would close a loop; close loops with impulse joints"));
                }
                above = parents.get(&id).copied().or_else(|| self.parent_of(id, bodies));
            }
        }
        Ok(())
    }

    /// Returns the parent of a link in its multibody, unless one of the two is among the bodies `but`, which
    /// are in id order.
    fn parent_of(&self, id: BodyId, but: &[BodyRecord]) -> Option<BodyId> {
        let stays = |end: BodyId| but.binary_search_by_key(&end, |body| body.id).is_err();
        if !stays(id) {
            return None;
        }
        let mut links = self.joints_of(id).filter(|joint| joint.link.is_some() && joint.b == id);
        links.next().map(|joint| joint.a).filter(|&parent| stays(parent))
    }

    /// Removes a joint from every region. Returns whether any held it.
    pub fn remove_joint(&mut self, id: JointId) -> bool {
        self.is_placed = false;
        let mut held = false;
        for Side { region, .. } in &mut self.sides {
            held |= region.has_joint(id);
            region.remove_joint(id);
        }
        held
    }

    /// Checks bodies and their joints. The bodies are in id order, and either not held here or to be removed
    /// before they are inserted.
    fn check(&self, bodies: &[BodyRecord], joints: &[JointRecord]) -> Result<(), HostError> {
        for body in bodies {
            check_state(body)?;
            for collider in &body.traits.colliders {
                self.shapes.look_at(collider.shape)?;
            }
        }
        if let Some(pair) = bodies.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return Err(HostError::Taken(pair[0].id));
        }
        if let Some(joint) = joints.iter().find(|joint| joint.a == joint.b) {
            return Err(HostError::Itself { joint: joint.id, body: joint.a });
        }
        self.check_links(joints, bodies)?;
        for joint in joints {
            for body in [joint.a, joint.b] {
                let new = bodies.binary_search_by_key(&body, |body| body.id).is_ok();
                // On a node the other end may be held elsewhere: only a host of all regions can tell.
                let all_here = self.sides.len() == self.partition.len();
                if !new && all_here && !self.held(body) {
                    return Err(HostError::Untied { joint: joint.id, body });
                }
            }
        }
        Ok(())
    }

    /// Returns the traits of a body that is owned here or immovable.
    pub fn traits(&self, id: BodyId) -> Option<&BodyTraits> {
        match self.owned(id) {
            Some((region, handle)) => Some(&region.slot(handle).traits),
            None => self.statics.body(id).map(|body| &*body.traits),
        }
    }

    /// Returns the user data of a body that is owned here or immovable.
    pub(crate) fn user_data(&self, id: BodyId) -> Option<u128> {
        match self.owned(id) {
            Some((region, handle)) => Some(region.physics().bodies[handle].user_data),
            None => self.statics.body(id).map(|body| body.user_data),
        }
    }

    /// Inserts one checked body. It belongs to the region where it is.
    fn insert_alone(&mut self, body: BodyRecord) -> Result<(), HostError> {
        if body.traits.kind == BodyKind::Fixed {
            return self.insert_placed(vec![body], &[usize::MAX], &[false], &[]);
        }
        let place = self.place_of[self.partition.rank_at(body.state.pose.translation)];
        // A body like it has made room for it.
        if place.is_none_or(|place| self.sides[place].region.newest_like(&body).is_none()) {
            self.make_room(&body)?;
        }
        let Some(place) = place else { return Ok(()) };
        let region = &mut self.sides[place].region;
        settle_origin(region, &self.statics, std::iter::once(&body));
        Ok(self.insert_owned(place, body, false)?)
    }

    /// Inserts bodies in id order, as one Rapier world would be filled. `owners` are ranks; `whole` says of
    /// each body whether its island lies in one region.
    pub(super) fn insert_placed(
        &mut self,
        bodies: Vec<BodyRecord>,
        owners: &[usize],
        whole: &[bool],
        joints: &[JointRecord],
    ) -> Result<(), HostError> {
        for body in &bodies {
            if body.traits.kind != BodyKind::Fixed {
                self.make_room(body)?;
            } else if self.statics.body(body.id).is_none() {
                self.statics.add(body.clone(), &self.shapes)?;
            }
        }
        let standing = match bodies.iter().any(placement::lies) {
            true => placement::standing(&bodies, owners, &self.shapes)?,
            false => vec![false; bodies.len()],
        };
        // Region by region, so that what Rapier allocates for the bodies of one world lies together. Filled
        // in turns, two worlds share cache lines, which cost a tenth of the step (40,000 free boxes in two
        // regions).
        for place in 0..self.sides.len() {
            let region = &mut self.sides[place].region;
            let movable = |body: &BodyRecord| body.traits.kind != BodyKind::Fixed;
            let rank = region.rank();
            let own = bodies.iter().zip(owners).filter(|(body, owner)| **owner == rank && movable(body));
            settle_origin(region, &self.statics, own.map(|(body, _)| body));
            let stands = bodies.iter().zip(owners).zip(&standing).filter(|((_, owner), _)| **owner == rank);
            let stands: Vec<_> = stands.filter(|(_, stands)| **stands).map(|((body, _), _)| body).collect();
            let warms = !stands.is_empty() && !region.holds_movable();
            // Bodies that have yet to come to rest come later: in silent steps they would lose their bounces.
            for late in [false, true] {
                let all = bodies.iter().zip(owners).zip(whole).zip(&standing);
                for (((body, &owner), &whole), stands) in all {
                    let is_late = warms && body.traits.kind == BodyKind::Dynamic && !stands;
                    if body.traits.kind == BodyKind::Fixed && !late {
                        self.statics.insert_near(body.id, &mut self.sides[place].region, &self.shapes)?;
                    } else if owner == rank && is_late == late && body.traits.kind != BodyKind::Fixed {
                        self.insert_owned(place, body.clone(), whole)?;
                    }
                }
                if warms && !late {
                    self.warm_up(place, &stands);
                }
            }
            if warms {
                self.sides[place].region.order_fresh();
            }
        }
        for joint in joints {
            for Side { region, .. } in &mut self.sides {
                let movable = [joint.a, joint.b].into_iter().any(|id| {
                    let role = region.handle_of(id).and_then(|handle| region.role_of(handle));
                    role.is_some_and(|(_, role)| role != Ownership::Immovable)
                });
                if movable {
                    self.statics.ensure(region, joint, &self.shapes)?;
                    region.insert_joint(joint);
                }
            }
            self.share_ends(joint, &bodies, owners);
        }
        Ok(())
    }

    /// Makes bodies that were inserted into a region in which no others can move find their contacts as they
    /// lay when these were found elsewhere.
    fn warm_up(&mut self, place: usize, standing: &[&BodyRecord]) {
        let StepSettings { coupling, exchanges, dt_s, solver_iterations, integration, .. } = self.settings;
        let steps = coupling.first_steps(exchanges);
        let parameters = IntegrationParameters {
            dt: dt_s / steps as f32,
            num_solver_iterations: solver_iterations.div_ceil(steps).max(1),
            ..integration
        };
        let region = &self.sides[place].region;
        let lay = standing.iter().filter_map(|body| {
            let lay = placement::lying(body).state.pose;
            Some((region.handle_of(body.id)?, convert::region_from_world(region.anchor(), &lay)))
        });
        let lay: Vec<_> = lay.collect();
        let tick = self.tick;
        threads::alone(&mut self.sides, move |sides| sides[place].region.warm_up(tick, &parameters, &lay));
    }

    /// Widens the halo for a movable body. If it is wide enough, checkpoints go on sharing the partition.
    fn make_room(&mut self, body: &BodyRecord) -> Result<(), ShapeError> {
        let reach_m = reach_of_record(body, &self.shapes)?;
        if self.partition.is_widened_by(reach_m) {
            Arc::make_mut(&mut self.partition).widen_halo(reach_m);
        }
        Ok(())
    }

    /// Inserts a movable body into the region that owns it, and notes that it does.
    fn insert_owned(&mut self, place: usize, body: BodyRecord, whole: bool) -> Result<(), ShapeError> {
        let (id, region) = (body.id, &mut self.sides[place].region);
        let handle = region.insert(body, Ownership::Owner, RegionSet::EMPTY, &self.shapes)?;
        region.slot_mut(handle).whole = whole;
        self.statics.cover(region, handle, &self.shapes)?;
        self.owner_index.set(id, Home { rank: region.rank(), handle });
        Ok(())
    }

    /// Makes the region of each end of a joint hold the other end too, however far they lie apart.
    fn share_ends(&mut self, joint: &JointRecord, bodies: &[BodyRecord], owners: &[usize]) {
        let [Some(a), Some(b)] = movable_ends(joint, bodies).map(|end| Some(owners[end?])) else { return };
        if a == b || !self.settings.coupling.shares_mass() {
            return;
        }
        for (id, here, there) in [(joint.a, a, b), (joint.b, b, a)] {
            if let Some(place) = self.place_of.get(here).copied().flatten()
                && let Some(handle) = self.sides[place].region.handle_of(id)
            {
                self.sides[place].region.slot_mut(handle).holders.insert(there);
            }
        }
    }

    /// Collects this body, the movable bodies that joints tie to it, and the joints of all of them.
    pub(super) fn gather_assembly(
        &self,
        body: BodyId,
        bodies: &mut BTreeMap<BodyId, BodyRecord>,
        ties: &mut BTreeMap<JointId, JointRecord>,
    ) {
        let mut open = vec![body];
        while let Some(body) = open.pop() {
            if bodies.contains_key(&body) || self.statics.body(body).is_some() {
                continue;
            }
            let Some(record) = self.record(body) else { continue };
            bodies.insert(body, record);
            for joint in self.joints_of(body) {
                open.extend([joint.a, joint.b]);
                ties.insert(joint.id, joint);
            }
        }
    }

    /// Returns the whole records of those of these bodies that are held here, for another process: with how
    /// they lay when their contacts were found, as far as that is known.
    pub(crate) fn records(&self, ids: &[BodyId]) -> Vec<BodyRecord> {
        let offsets: BTreeMap<_, _> =
            self.regions().flat_map(|region| region.contact_offsets(self.tick, ids)).collect();
        let mut bodies: Vec<_> = ids.iter().filter_map(|id| self.record(*id)).collect();
        for body in &mut bodies {
            body.state.contact_offset = offsets.get(&body.id).copied();
        }
        bodies
    }

    pub(super) fn present_place(&self, id: BodyId) -> (usize, RegionSet) {
        match self.owned(id) {
            Some((region, handle)) => (region.rank(), region.slot(handle).holders),
            None => (usize::MAX, RegionSet::EMPTY),
        }
    }
}

/// Checks where a body is and how it moves.
pub(super) fn check_state(body: &BodyRecord) -> Result<(), HostError> {
    if body.state.pose.is_valid() && body.state.velocity.is_finite() {
        return Ok(());
    }
    Err(HostError::NotFinite(body.id))
}

/// Gives a region that owns no body yet a floating origin that suits the bodies to come.
fn settle_origin<'a>(region: &mut Region, statics: &Statics, own: impl Iterator<Item = &'a BodyRecord>) {
    let mut places = own.map(|body| body.state.pose.translation).peekable();
    if places.peek().is_some()
        && !region.owns_any()
        && let Some(anchor) = better_anchor(region.anchor(), places)
    {
        region.set_anchor(anchor, |id| statics.pose(id));
    }
}

/// Returns how far a recorded body reaches from its position, in metres.
fn reach_of_record(body: &BodyRecord, shapes: &ShapeLibrary) -> Result<f32, ShapeError> {
    let mut reach = body.traits.vehicle.as_ref().map_or(0.0, Vehicle::reach_m);
    for collider in &body.traits.colliders {
        let ball = shapes.look_at(collider.shape)?.compute_bounding_sphere(&convert::pose(collider.pose));
        reach = reach.max(ball.center.length() + ball.radius + collider.contact_skin_m);
    }
    Ok(reach)
}
