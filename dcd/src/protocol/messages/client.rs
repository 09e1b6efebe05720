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
    /// A new avatar.
    Spawn {
        /// Its id must be one of the client's own.
        body: BodyRecord,
        /// The shapes that its colliders name, as far as the world may not know them, with the parts of those, and no others.
        shapes: Vec<ShapeRecord>,
    },
    /// The avatar disappears for good.
    Despawn(BodyId),
    /// The client goes; its avatars wait for its return.
    Leave,
    /// To the leader, and to each new one again: the client's area of interest from now on; `None` is everything. To the server, by a
    /// client that joined with one: the area whose scenery it wants to know.
    Interest(Option<Area>),
    /// To the server: bodies that the client, which joined with an area of interest, has heard of and does not know; at most
    /// [`MAX_INTRODUCED`].
    Introduce(Vec<BodyId>),
    /// The client's query about bodies. To the leader alone, and sent again until it is answered.
    Ask(Query),
    /// To the leader: which datagrams of states have come, and how many more may.
    Heard(Heard),
    /// To the server, over the client's own link: a client that may build changes the world, in this order. Answered by
    /// [`ToClient::Built`] once it is on record.
    Build {
        /// Counts the messages of this kind.
        number: u64,
        /// At most [`MAX_BUILD_OPS`](super::MAX_BUILD_OPS).
        ops: Vec<BuildOp>,
    },
    /// To the leader: nothing is heard from the member that it named as the one who tells ([`ToClient::ToldBy`]). It is to tell the client itself.
    Untold,
}

/// A client's acknowledgement of states.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Heard {
    /// Which [`Part::series`] it is about.
    pub series: u32,
    /// The datagrams that have come since the last one: the number of the first, and how many follow each other; at most [`MAX_HEARD`].
    pub datagrams: Vec<(u32, u32)>,
    /// Whether the client cannot read what it is told: the series is to begin anew.
    pub lost: bool,
    /// The most bytes that the client wants to be sent, in a second; 0: as many as the link carries.
    pub bytes_per_s: u32,
}

/// The most runs of datagrams that are acknowledged at once.
pub const MAX_HEARD: usize = 64;

/// The most bodies that a client asks for at once.
pub const MAX_INTRODUCED: usize = 1_024;

/// A client's area of interest: a ball of world space. Thanks to the margins around it, it can move a little, and bodies can
/// cross its edge to and fro, without a message between client and leader.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Area {
    /// Metres of world space.
    pub centre: [f64; 3],
    /// Metres, above 0.
    pub radius_m: f64,
}

impl Area {
    /// Returns the area around an avatar of its own of which a client always receives states: what may touch it, unless it is long.
    /// Bodies count by their origins, since leaders do not know their sizes.
    #[doc(hidden)]
    pub const fn around_avatar(centre: [f64; 3]) -> Self {
        Self { centre, radius_m: 8.0 }
    }

    /// Returns the area in which a client with this interest knows the scenery: so much wider that it need not ask often.
    #[must_use]
    #[doc(hidden)]
    pub fn with_surroundings(&self) -> Self {
        Self { radius_m: (1.5 * self.radius_m + 8.0).min(WORLD_REACH_M), ..*self }
    }

    /// Returns whether a body at this point, which reaches so far, is in it or at its edge.
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

    /// Returns whether states of bodies at this point are certain to be sent: in the area and half a margin.
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

    /// Returns whether what this area covers contains all of the other.
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

/// A message of the leader or server to a client.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum ToClient {
    /// The server's answer to [`Hello`](super::Hello); chunks of the world follow, then [`ToClient::WorldEnd`].
    Welcome {
        /// The client's id.
        id: ClientId,
        /// Start of its logical time: beyond all that an earlier process of the same client came to.
        logical_time: u64,
        /// The indices of the next body and the next joint that it may build.
        next_built: (u32, u32),
        /// The world.
        world: EnvironmentProperties,
    },
    /// Part of the world.
    Chunk(Chunk),
    /// The world is whole.
    WorldEnd,
    /// Who leads the group; `None` while nobody computes the world.
    LeaderIs {
        /// The client's group: states of other groups do not concern it.
        group: GroupId,
        /// Since which view.
        view: ViewNumber,
        /// Whom to connect to.
        leader: Option<Member>,
        /// The tree of the world's regions; `None` while nobody computes them.
        tree: Option<DistributionTree>,
        /// Which member computes each region; none while nobody does.
        allocation: Allocation,
    },
    /// The regions of the client's group have changed, or are dealt out anew, under the same leader.
    Regions {
        /// Their tree.
        tree: DistributionTree,
        /// Which member computes each region.
        allocation: Allocation,
    },
    /// A body appeared after the client joined.
    Inserted {
        /// The body.
        body: BodyRecord,
        /// Shapes new to the world.
        shapes: Vec<ShapeRecord>,
        /// Joints between bodies that are in the world by now.
        joints: Vec<JointRecord>,
    },
    /// A body disappeared.
    Removed(BodyId),
    /// The server's program, or a client that may build, changed what a body or a joint is, which the client may not know.
    Altered(Alteration),
    /// A joint disappeared, which the client may not know.
    JointRemoved(JointId),
    /// No body has these shapes any more; whoever has one later brings it anew.
    ShapesGone(Vec<ShapeHash>),
    /// Bodies that moved: to the client in the leader's process, or to say that time goes on though none has.
    States {
        /// Their origin and time.
        stamp: Stamp,
        /// In id order.
        states: Vec<SharedState>,
    },
    /// The same as [`Self::States`], quantised and coded, in as many messages as there must be.
    CompactStates {
        /// Their origin and time.
        stamp: Stamp,
        /// The bodies.
        part: Part,
    },
    /// Contacts of the client's own avatars, each pair once.
    Contacts {
        /// In which tick.
        tick: Tick,
        /// Beginnings and ends.
        touches: Vec<Touch>,
        /// Forces above a threshold.
        forces: Vec<ContactForce>,
    },
    /// Answer to [`FromClient::Ask`].
    Answer {
        /// The question's.
        number: u64,
        /// What was found.
        found: QueryResult,
    },
    /// An input was refused.
    Rejected {
        /// The body concerned.
        body: Option<BodyId>,
        /// Why.
        reason: Refusal,
    },
    /// What was to be built by the message of this number is on record, but for what was refused before.
    Built(u64),
    /// From the leader: this member tells the client the states of bodies once they are linked, and till then, or if it is `None`, the leader
    /// itself does. All else goes on over the link to the leader.
    ToldBy(Option<Member>),
}

impl ToClient {
    /// Returns whether it tells of what has come, gone or become something else in the world, but for avatars.
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

/// States of bodies in the format of the module `delta`: what fits a datagram of a batch, which is what a client is told at once.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Part {
    /// The series that it belongs to: nothing refers to states of an earlier one.
    pub series: u32,
    /// Counts batches of the series.
    pub batch: u32,
    /// Counts datagrams of the series.
    pub number: u32,
    /// The states, coded.
    pub states: Vec<u8>,
}

/// The origin and time of states: group, tick, and whether they are speculative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Stamp {
    /// The group that computed them: epochs and ticks of unlike groups do not compare.
    pub group: GroupId,
    /// After which tick.
    pub tick: Tick,
    /// When the leader opened the tick, microseconds of its own clock; 0 if that is not known.
    pub opened_us: u64,
    /// The logical time of the receiver's newest input that the tick, or one before it, has applied; 0 if there was none.
    pub applied: u64,
    /// How many ticks before the one that it names that input came, in 0 or more; below 0: too late by so many. 0 if it names none.
    pub early: i8,
    /// Whether the tick was speculative: computed without the other members. A later one that is not counts whatever its tick.
    pub speculative: bool,
}

impl Stamp {
    /// Returns the stamp of a tick of which is not known when it was opened.
    pub fn untimed(group: GroupId, tick: Tick, speculative: bool) -> Self {
        Self { group, tick, opened_us: 0, applied: 0, early: 0, speculative }
    }
}

/// The reason why a client's input, or a join, was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, thiserror::Error)]
pub enum Refusal {
    /// Unequal protocol versions.
    #[error("protocol version {theirs} does not match the server's {ours}: install the same dcd on both")]
    Version {
        /// The joiner's.
        theirs: u32,
        /// The server's.
        ours: u32,
    },
    /// A body of somebody else.
    #[error("the body does not belong to this client: a client moves its own avatars only")]
    NotYours,
    /// The body is not in the world.
    #[error("no such body or joint: insert it first")]
    Unknown,
    /// The body is there already.
    #[error("a body or joint of this id exists: choose another index")]
    Exists,
    /// Above [`EnvironmentProperties::avatar_speed_limit`], or a spin of more than a quarter of a turn per tick.
    #[error(
        "faster than the world allows: stay below its avatar speed limit, and a quarter of a turn per tick"
    )]
    TooFast,
    /// A jump farther than the avatar could have moved since its last one, or in a second, at its speed limit.
    #[error(
        "a jump too far: at most the way that the avatar speed limit allows since the last jump, and at most that of a second"
    )]
    TooFar,
    /// An input with a newer logical time was there before.
    #[error("older than the last update of this avatar: let the logical time grow")]
    Late,
    /// A collider names a shape that the world does not know, that cannot be built, or that what a client moves, or builds, cannot have.
    #[error(
        "a shape is unknown, cannot be built, or is not for clients: send it with the body, a hull, box, ball or compound of them, and for \
         what a builder fixes a mesh or terrain, but neither voxels nor half-spaces"
    )]
    Shape,
    /// Too many bodies or updates at once, or too many shapes brought (`cluster::MAX_SHAPE_BYTES`).
    #[error("too many bodies, new shapes or updates: fewer, or less often; use shapes again")]
    TooMany,
    /// The body would cost those who compute it too much.
    #[error("the body costs too much: {0}")]
    Costly(Costs),
    /// It is to build, and its certificate does not let it.
    #[error("its token does not let this client build: join with one of `dcd token --role builder`")]
    MayNotBuild,
    /// It may build, but not so: no program that uses this library asks for it.
    #[error(
        "a client builds under ids of its own, ties what it inserts, and leaves avatars, the kind of fixed bodies and the shapes of others \
         as they are"
    )]
    NotToBeBuilt,
}

/// What an avatar, or a body that a client builds, has too much of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode, thiserror::Error)]
pub enum Costs {
    /// Solver or PGS iterations beyond the world's own.
    #[error("at most 8 extra solver and PGS iterations")]
    Iterations,
    /// Corners of hulls and boxes, with the client's other avatars.
    #[error("at most 20,000 corners of all avatars of a client together: use simpler hulls, or fewer")]
    Corners,
    /// Reach from its origin.
    #[error(
        "it may reach at most 100 m from its origin, and, built, look at most 10 m around its colliders (contact skin and soft CCD)"
    )]
    Size,
    /// Characters and vehicles, with the client's other ones.
    #[error("at most 32 characters and vehicles of a client: make the others of another kind")]
    Characters,
    /// Steps, gap or mass of a character.
    #[error(
        "a character of a client takes steps of at most 1 m, is drawn down by as much, keeps a gap of at most 0.1 m, and weighs at most 10 t"
    )]
    Strides,
    /// Wheels of a vehicle: too many, too far out, too stiff.
    #[error(
        "a vehicle of a client has at most 8 wheels within 10 m of its origin, whose suspensions together speed it up by at most 200 \
         m/s² and are damped by at most 60 per second"
    )]
    Wheels,
    /// Avatars of the same client where it would begin, or others that it has built.
    #[error("it begins where 64 others of this client are, or others with 1,024 colliders: spread them out")]
    Overlaps,
    /// Corners of all that the client has built.
    #[error("at most 200,000 corners of all that a client has built: use simpler hulls and meshes, or fewer")]
    BuiltCorners,
    /// Colliders of all that the client has built.
    #[error(
        "at most 16,384 colliders, parts of compounds included, of all that a client has built: use fewer"
    )]
    Colliders,
    /// Pairs of fixed bodies that are looked at in each step.
    #[error(
        "what a client builds does not ask for contacts of fixed bodies: leave out ActiveCollisionTypes::FIXED_FIXED"
    )]
    FixedPairs,
    /// Bytes, with its shapes and with what is tied to it.
    #[error("at most 60 KiB with its shapes and all that joints tie to it: use simpler shapes, or tie fewer")]
    Bytes,
}

/// An avatar input: the velocity or pose that its user asks for.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Input {
    /// Which avatar.
    pub body: BodyId,
    /// The client's clock, above 0: an older input never overwrites a newer one. 0 in what the server's program asks.
    pub logical_time: u64,
    /// The tick that is to apply it; the next one, if that is over, or 0.
    pub tick: Tick,
    /// Wanted velocity.
    pub velocity: Velocity,
    /// Wanted pose, for a jump.
    pub pose: Option<WorldPose>,
    /// What the driver of a vehicle does from now on; the velocity is left alone then.
    pub drive: Option<Drive>,
}

impl Input {
    /// Returns what a newer input of the same kind replaces: how a vehicle is driven is apart from where and how fast it is put.
    pub fn slot(&self) -> (BodyId, bool) {
        (self.body, self.drive.is_some())
    }

    /// Returns what does the same as this one after an older one that no tick has done: where that jumped, unless it jumps itself.
    #[must_use]
    pub(crate) fn after(self, before: &Self) -> Self {
        Self { pose: self.pose.or(before.pose), ..self }
    }

    /// Returns the pose that this body jumps to, if any: a client's character goes only where it can walk.
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
