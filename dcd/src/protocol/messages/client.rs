//! Defines the messages between clients and their leader or the server.

use bincode::{Decode, Encode};

use super::{BuildOp, Chunk, EnvironmentProperties, Member, Query, QueryResult, ViewNumber};
use crate::protocol::{
    Alteration, BodyRecord, BodyTraits, ContactForce, Drive, JointRecord, ShapeHash, ShapeRecord,
    SharedState, Touch, Velocity, WORLD_REACH_M, WorldPose,
};
use crate::space::{Allocation, BodyId, ClientId, DistributionTree, GroupId, JointId, Tick};

/// A message of a client to its leader, or to the server when there is none.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum FromClient {
    /// Moves an avatar.
    Input(Input),
    /// Inserts a new avatar.
    Spawn {
        /// The body, whose id must be one of the client's own.
        body: BodyRecord,
        /// The shapes that its colliders name, with the parts of those, as far as the world may not know
        /// them; no others.
        shapes: Vec<ShapeRecord>,
    },
    /// Removes an avatar for good.
    Despawn(BodyId),
    /// Tells that the client leaves. Its avatars wait for its return.
    Leave,
    /// To the leader, and again to each new one: the client's area of interest from now on; `None` is
    /// everything. To the server, by a client that joined with an area: the area whose scenery it wants to
    /// know.
    Interest(Option<Area>),
    /// To the server, by a client that joined with an area of interest: bodies that it has heard of and does
    /// not know; at most [`MAX_INTRODUCED`].
    Introduce(Vec<BodyId>),
    /// Asks a query about bodies. Sent to the leader alone, again and again until it is answered.
    Ask(Query),
    /// To the leader: which datagrams of states have arrived, and how many bytes more may be sent.
    Heard(Heard),
    /// To the server, over the client's own link: a builder changes the world, in this order. The server
    /// answers with [`ToClient::Built`] once the changes are on record.
    Build {
        /// The number of the message among those of this kind.
        number: u64,
        /// The changes; at most [`MAX_BUILD_OPS`](super::MAX_BUILD_OPS).
        ops: Vec<BuildOp>,
    },
    /// To the leader: the client hears nothing from the member that the leader named as the one who tells it
    /// ([`ToClient::ToldBy`]). The leader is to tell the client itself.
    Untold,
}

/// A client's acknowledgement of states.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Heard {
    /// The [`Part::series`] that it is about.
    pub series: u32,
    /// The datagrams that have arrived since the last acknowledgement, as runs: the number of the first, and
    /// how many follow each other; at most [`MAX_HEARD`] runs.
    pub datagrams: Vec<(u32, u32)>,
    /// Says whether the client cannot read what it is told, so that the series is to begin anew.
    pub lost: bool,
    /// The most bytes per second that the client wants to be sent; 0 for as many as the link carries.
    pub bytes_per_s: u32,
}

/// The most runs of datagrams that are acknowledged at once.
pub const MAX_HEARD: usize = 64;

/// The most bodies that a client asks for at once.
pub const MAX_INTRODUCED: usize = 1_024;

/// A client's area of interest: a ball in world space. There are margins around it, so that it can move a
/// little, and bodies can cross its edge to and fro, without a message between client and leader.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Area {
    /// The centre in world space, metres.
    pub centre: [f64; 3],
    /// The radius, metres; above 0.
    pub radius_m: f64,
}

impl Area {
    /// Returns the area around one of its own avatars of which a client always receives states: that of all
    /// that may touch the avatar, unless it is long. Bodies count by their origins, since leaders do not know
    /// their sizes.
    #[doc(hidden)]
    pub const fn around_avatar(centre: [f64; 3]) -> Self {
        Self { centre, radius_m: 8.0 }
    }

    /// Returns the area in which a client with this interest knows the scenery. It is wider than the
    /// interest, so that the client need not ask often.
    #[must_use]
    #[doc(hidden)]
    pub fn with_surroundings(&self) -> Self {
        Self { radius_m: (1.5 * self.radius_m + 8.0).min(WORLD_REACH_M), ..*self }
    }

    /// Returns whether a body at this point that reaches `reach_m` is in the area or at its edge.
    #[doc(hidden)]
    pub fn meets(&self, point: [f64; 3], reach_m: f64) -> bool {
        self.is_within(point, self.radius_m + self.margin_m() + reach_m)
    }

    fn margin_m(&self) -> f64 {
        (0.1 * self.radius_m).max(1.0)
    }

    fn is_within(&self, point: [f64; 3], distance_m: f64) -> bool {
        let squares = (0..3).map(|i| (point[i] - self.centre[i]).powi(2));
        squares.sum::<f64>() <= distance_m * distance_m
    }

    /// Returns whether states of bodies at this point are certain to be sent: it lies within the area and
    /// half a margin.
    #[doc(hidden)]
    pub fn covers(&self, point: [f64; 3]) -> bool {
        self.is_within(point, self.radius_m + 0.5 * self.margin_m())
    }

    /// Returns whether states of a body that comes to this point are sent from then on.
    #[doc(hidden)]
    pub fn enters(&self, point: [f64; 3]) -> bool {
        self.is_within(point, self.radius_m + self.margin_m())
    }

    /// Returns the corners of a box around all points at which [`Area::enters`] holds.
    pub(crate) fn entered_from(&self) -> ([f64; 3], [f64; 3]) {
        let reach_m = self.radius_m + self.margin_m();
        (self.centre.map(|at| at - reach_m), self.centre.map(|at| at + reach_m))
    }

    /// Returns whether a body whose states are already sent continues to be sent at this point.
    #[doc(hidden)]
    pub fn keeps(&self, point: [f64; 3]) -> bool {
        self.is_within(point, self.radius_m + 1.5 * self.margin_m())
    }

    /// Returns whether what this area covers contains all of the other area.
    #[doc(hidden)]
    pub fn stands_for(&self, other: &Self) -> bool {
        self.radius_m == other.radius_m && self.is_within(other.centre, 0.5 * self.margin_m())
    }

    /// Returns whether a smaller area lies in this one.
    #[doc(hidden)]
    pub fn contains(&self, other: &Self) -> bool {
        self.is_within(other.centre, self.radius_m - other.radius_m) && other.radius_m <= self.radius_m
    }
}

/// A message of the leader or the server to a client.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToClient {
    /// Answers [`Hello`](super::Hello), from the server. Chunks of the world follow, then
    /// [`ToClient::WorldEnd`].
    Welcome {
        /// The client's id.
        id: ClientId,
        /// The start of its logical time: beyond all that an earlier process of the same client came to.
        logical_time: u64,
        /// The indices of the next body and the next joint that it may build.
        next_built: (u32, u32),
        /// Tells this world from others that the same server served before.
        incarnation: u64,
        /// The world.
        world: EnvironmentProperties,
    },
    /// Brings a part of the world.
    Chunk(Chunk),
    /// Tells that the world is complete.
    WorldEnd,
    /// Tells who leads the group.
    LeaderIs {
        /// The client's group. States of other groups do not concern it.
        group: GroupId,
        /// The view since which the leader leads.
        view: ViewNumber,
        /// The leader, to connect to; `None` while nobody computes the world.
        leader: Option<Member>,
        /// The tree of the world's regions; `None` while nobody computes them.
        tree: Option<DistributionTree>,
        /// The member that computes each region; empty while nobody computes them.
        allocation: Allocation,
    },
    /// Tells that the regions of the client's group have changed, or are dealt out anew, under the same
    /// leader.
    Regions {
        /// The tree of the regions.
        tree: DistributionTree,
        /// The member that computes each region.
        allocation: Allocation,
    },
    /// Brings a body that appeared after the client joined.
    Inserted {
        /// The body.
        body: BodyRecord,
        /// The shapes that are new to the world.
        shapes: Vec<ShapeRecord>,
        /// The joints between bodies that are in the world by now.
        joints: Vec<JointRecord>,
    },
    /// Tells that a body disappeared.
    Removed(BodyId),
    /// Tells that the server's program or a builder changed what a body or a joint is, which the client may
    /// not know.
    Altered(Alteration),
    /// Tells that a joint disappeared, which the client may not know.
    JointRemoved(JointId),
    /// Tells that no body has these shapes any more. A process that has one of them later brings it anew.
    ShapesGone(Vec<ShapeHash>),
    /// Tells states of bodies that moved: to the client in the leader's process, or to say that time goes on
    /// though no body has moved.
    States {
        /// The origin and time of the states.
        stamp: Stamp,
        /// The states, in id order.
        states: Vec<SharedState>,
    },
    /// Tells the same as [`Self::States`], quantised and coded, in as many messages as needed.
    CompactStates {
        /// The origin and time of the states.
        stamp: Stamp,
        /// The states.
        part: Part,
    },
    /// Tells contacts of the client's own avatars, each pair once.
    Contacts {
        /// The tick of the contacts.
        tick: Tick,
        /// The contacts that began or ceased.
        touches: Vec<Touch>,
        /// The forces above a threshold.
        forces: Vec<ContactForce>,
    },
    /// Answers [`FromClient::Ask`].
    Answer {
        /// The number of the query.
        number: u64,
        /// The result.
        found: QueryResult,
    },
    /// Tells that an input was refused.
    Rejected {
        /// The body concerned.
        body: Option<BodyId>,
        /// The reason.
        reason: Refusal,
    },
    /// Tells that the changes in the builder's message of this number are on record, except those that were
    /// refused before.
    Built(u64),
    /// From the leader: this member tells the client the states of bodies once the two are linked. Until
    /// then, or if it is `None`, the leader does so itself. Everything else goes on over the link to the
    /// leader.
    ToldBy(Option<Member>),
}

impl ToClient {
    /// Returns whether the message tells that something other than an avatar came, went or changed in the
    /// world.
    #[doc(hidden)]
    pub fn changes_world(&self) -> bool {
        match self {
            Self::Inserted { body, .. } => body.id.client().is_none(),
            Self::Removed(body) => body.client().is_none(),
            Self::Altered(_) | Self::JointRemoved(_) => true,
            _ => false,
        }
    }
}

/// A part of a batch of states, in the format of the module `delta`: as much as fits a datagram. A client is
/// told one batch at a time.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Part {
    /// The series that the part belongs to. Nothing refers to states of an earlier series.
    pub series: u32,
    /// The number of the batch in the series.
    pub batch: u32,
    /// The number of the datagram in the series.
    pub number: u32,
    /// The coded states.
    pub states: Vec<u8>,
}

/// The origin and time of states: group, tick, and whether they are speculative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Stamp {
    /// The group that computed the states. Epochs and ticks of different groups do not compare.
    pub group: GroupId,
    /// The tick after which the states hold.
    pub tick: Tick,
    /// The time at which the leader opened the tick, microseconds of its own clock; 0 if that is not known.
    pub opened_us: u64,
    /// The logical time of the receiver's newest input that was applied by this tick or an earlier one; 0 if
    /// there was none.
    pub applied: u64,
    /// How many ticks before the tick that it names that input arrived, 0 or more; below 0 if it was too late
    /// by so many. 0 if it names no tick.
    pub early: i8,
    /// Says whether the tick was speculative, that is computed without the other members. A later state that is
    /// not speculative counts, whatever its tick.
    pub speculative: bool,
}

impl Stamp {
    /// Returns the stamp of a tick of which it is not known when it was opened.
    pub fn untimed(group: GroupId, tick: Tick, speculative: bool) -> Self {
        Self { group, tick, opened_us: 0, applied: 0, early: 0, speculative }
    }
}

/// The reason for which a client's input, or a join, was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, thiserror::Error)]
pub enum Refusal {
    /// The two processes have different protocol versions.
    #[error("protocol version {theirs} does not match the server's {ours}: install the same dcd on both")]
    Version {
        /// The version of the process that joins.
        theirs: u32,
        /// The version of the server.
        ours: u32,
    },
    /// The body is another client's, or the world's own.
    #[error("the body does not belong to this client: a client moves its own avatars only")]
    NotYours,
    /// The body or joint is not in the world.
    #[error("no such body or joint: insert it first")]
    Unknown,
    /// A body or joint of this id is in the world already.
    #[error("a body or joint of this id exists: choose another index")]
    Exists,
    /// The avatar would move faster than [`EnvironmentProperties::avatar_speed_limit`], or spin by more than
    /// a quarter of a turn per tick.
    #[error(
        "faster than the world allows: stay below its avatar speed limit, and a quarter of a turn per tick"
    )]
    TooFast,
    /// The avatar would jump farther than its speed limit allows since its last jump, or in a second.
    #[error(
        "a jump too far: at most the way that the avatar speed limit allows since the last jump, and at most that of a second"
    )]
    TooFar,
    /// An input of this avatar with a newer logical time arrived before.
    #[error("older than the last update of this avatar: let the logical time grow")]
    Late,
    /// A collider names a shape that the world does not know, that cannot be built, or that an avatar or a
    /// builder's body may not have.
    #[error(
        "a shape is unknown, cannot be built, or is not for clients: send it with the body, a hull, box, ball or compound of them, and for \
         what a builder fixes a mesh or terrain, but neither voxels nor half-spaces"
    )]
    Shape,
    /// Too many bodies or updates at once, or too many new shapes (`cluster::MAX_SHAPE_BYTES`).
    #[error("too many bodies, new shapes or updates: fewer, or less often; use shapes again")]
    TooMany,
    /// The body would cost the nodes too much.
    #[error("the body costs too much: {0}")]
    Costly(Costs),
    /// The client asked to build, and its certificate does not let it.
    #[error("its token does not let this client build: join with one of `dcd token --role builder`")]
    MayNotBuild,
    /// The client is a builder, and builders may not do this. No program that uses this library asks for it.
    #[error(
        "a client builds under ids of its own, ties what it inserts, and leaves avatars, the kind of fixed bodies and the shapes of others \
         as they are"
    )]
    NotToBeBuilt,
}

/// The property of which an avatar, or a builder's body, has too much.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, thiserror::Error)]
pub enum Costs {
    /// Solver or PGS iterations beyond the world's own.
    #[error("at most 8 extra solver and PGS iterations")]
    Iterations,
    /// Corners of hulls and boxes, together with the client's other avatars.
    #[error("at most 20,000 corners of all avatars of a client together: use simpler hulls, or fewer")]
    Corners,
    /// The reach of the body from its origin.
    #[error(
        "it may reach at most 100 m from its origin, and, built, look at most 10 m around its colliders (contact skin and soft CCD)"
    )]
    Size,
    /// Characters and vehicles, together with the client's other ones.
    #[error("at most 32 characters and vehicles of a client: make the others of another kind")]
    Characters,
    /// The step height, gap or mass of a character.
    #[error(
        "a character of a client takes steps of at most 1 m, is drawn down by as much, keeps a gap of at most 0.1 m, and weighs at most 10 t"
    )]
    Strides,
    /// The wheels of a vehicle: too many, too far out, or too stiff.
    #[error(
        "a vehicle of a client has at most 8 wheels within 10 m of its origin, whose suspensions together speed it up by at most 200 \
         m/s² and are damped by at most 60 per second"
    )]
    Wheels,
    /// Other avatars of the client, or other bodies that it has built, where the body would begin.
    #[error("it begins where 64 others of this client are, or others with 1,024 colliders: spread them out")]
    Overlaps,
    /// Corners of all bodies that the client has built.
    #[error("at most 200,000 corners of all that a client has built: use simpler hulls and meshes, or fewer")]
    BuiltCorners,
    /// Colliders of all bodies that the client has built.
    #[error(
        "at most 16,384 colliders, parts of compounds included, of all that a client has built: use fewer"
    )]
    Colliders,
    /// Pairs of fixed bodies, which are looked at in each step.
    #[error(
        "what a client builds does not ask for contacts of fixed bodies: leave out ActiveCollisionTypes::FIXED_FIXED"
    )]
    FixedPairs,
    /// The bytes of the body with its shapes and all that is tied to it.
    #[error("at most 60 KiB with its shapes and all that joints tie to it: use simpler shapes, or tie fewer")]
    Bytes,
}

/// An input for an avatar: the velocity or pose that its user asks for.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Input {
    /// The avatar.
    pub body: BodyId,
    /// The client's logical clock, above 0: an older input never overwrites a newer one. It is 0 in what the
    /// server's program asks.
    pub logical_time: u64,
    /// The tick that is to apply the input; the next tick, if that one is over or 0.
    pub tick: Tick,
    /// The wanted velocity.
    pub velocity: Velocity,
    /// The wanted pose, for a jump.
    pub pose: Option<WorldPose>,
    /// What the driver of a vehicle does from now on. The velocity is left alone then.
    pub drive: Option<Drive>,
}

/// The speed, m/s, from which on a body that is set off is taken for a projectile.
const SHOT_M_S: f32 = 100.0;

impl Input {
    /// Returns whether this sets a body off so fast that it may fly over several regions in a few ticks.
    pub fn is_shot(&self) -> bool {
        let squared: f32 = self.velocity.linear.iter().map(|v| v * v).sum();
        self.drive.is_none() && squared >= SHOT_M_S * SHOT_M_S
    }

    /// Returns the slot in which a newer input replaces an older one: how a vehicle is driven is separate
    /// from where and how fast it is put.
    pub fn slot(&self) -> (BodyId, bool) {
        (self.body, self.drive.is_some())
    }

    /// Returns an input that does the same as this one after an older one that no tick has applied: it jumps
    /// where the older one jumped, unless it jumps itself.
    #[must_use]
    pub(crate) fn after(self, before: &Self) -> Self {
        Self { pose: self.pose.or(before.pose), ..self }
    }

    /// Returns the pose that this body jumps to, if any. A client's character goes only where it can walk.
    pub fn jump_of(&self, body: &BodyTraits) -> Option<WorldPose> {
        self.pose.filter(|_| self.logical_time == 0 || body.character.is_none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Check;

    #[test]
    fn areas_are_balls_of_finite_size() {
        let area = |centre: [f64; 3], radius_m| FromClient::Interest(Some(Area { centre, radius_m })).check();
        assert_eq!(area([1.0, 2.0, 3.0], 4.0), Ok(()));
        assert_eq!(FromClient::Interest(None).check(), Ok(()));
        for centre in [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0], [0.0, 0.0, 1e10]] {
            assert!(area(centre, 4.0).is_err());
        }
        for radius_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(area([0.0; 3], radius_m).is_err());
        }
        for radius_m in [1e-3, 1e9] {
            let all = Area { centre: [0.0; 3], radius_m }.with_surroundings();
            assert_eq!(FromClient::Interest(Some(all)).check(), Ok(()), "{radius_m}");
        }
    }

    #[test]
    fn an_area_stands_for_others_that_it_covers_and_is_told_beyond() {
        let area = |x| Area { centre: [x, 0.0, 0.0], radius_m: 20.0 };
        assert!(area(0.0).stands_for(&area(1.0)) && !area(0.0).stands_for(&area(1.1)));
        assert!(!area(0.0).stands_for(&Area { radius_m: 10.0, ..area(0.0) }));
        let at = |x| [x, 0.0, 0.0];
        assert!(area(0.0).covers(at(21.0)) && !area(0.0).covers(at(21.1)));
        assert!(area(0.0).enters(at(22.0)) && !area(0.0).enters(at(22.1)));
        assert!(area(0.0).keeps(at(23.0)) && !area(0.0).keeps(at(23.1)));
        let small = Area { radius_m: 8.0, ..area(12.0) };
        assert!(
            area(0.0).contains(&small) && !area(0.1 - 1.0).contains(&small) && !small.contains(&area(12.0))
        );
    }
}
