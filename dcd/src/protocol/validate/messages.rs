//! Checks messages: worlds, views, inputs, queries and answers, and everything that one role sends another.

use super::{all, ascending, finite, must, not_negative, within_reach};
use crate::fidelity::{Audited, COARSEST, FidelityReport, RegionState, Schedule, Signals};
use crate::protocol::*;
use crate::space::{Allocation, Balance, Bounds, DistributionTree, MAX_REGIONS, Viewpoint};

/// The bounds of what a region's state may say: the longest time of a step, milliseconds; the most awake
/// bodies; the largest error and cost of an audit.
const MOST_MS: f32 = 1e6;
const MOST_AWAKE: u32 = 1 << 24;
const MOST_FOUND: f32 = 1e6;

/// The highest level of the cells in which avatars are.
const MOST_LEVEL: i64 = 30;

/// The most border messages that a member takes in in one tick: those of a thousand others in 64 rounds.
const MOST_HEARD: usize = 1 << 16;

impl Check for EnvironmentProperties {
    fn check(&self) -> Result<(), Invalid> {
        if let Some((what, _, range)) = self.step.fault() {
            must(false, what, range)?;
        }
        must(self.halo_m.is_none_or(|v| v.is_finite() && v >= 0.0), "world.halo_m", "finite, not negative")?;
        not_negative(&[self.avatar_speed_limit], "world.avatar_speed_limit")?;
        self.thresholds.check()?;
        if let Some((what, _, range)) = self.balance.as_ref().and_then(Balance::fault) {
            must(false, what, range)?;
        }
        must(self.protocol.lag_ticks() <= u64::from(MAX_LAG), "world.lag_ticks", "at most 60")?;
        if let Some((what, _, range)) = self.fidelity.fault() {
            must(false, what, range)?;
        }
        fit(&self.viewpoints, "world.viewpoints")?;
        must((1..=MAX_STATE_TICKS).contains(&self.state_every), "world.state_every", "1 to 30")?;
        let Bounds { min, max } = self.tree.bounds();
        must(min.iter().chain(&max).all(|v| v.abs() <= WORLD_REACH_M), "world.bounds", "within 1e9 m")?;
        must(self.tree.is_sound(), "world.tree", "connected, cut inside its cells and within its limits")
    }
}

impl Check for Thresholds {
    fn check(&self) -> Result<(), Invalid> {
        not_negative(&[self.dead_reckoning_m, self.between_groups_m], "thresholds")?;
        let Some(delay) = self.delay else { return Ok(()) };
        not_negative(&[delay.inclusion_ms, delay.rejection_ms, delay.deviation_ms], "thresholds.delay")?;
        must(
            0.0 < delay.inclusion_ms && delay.inclusion_ms < delay.rejection_ms,
            "thresholds.inclusion_ms",
            "positive and below rejection_ms",
        )
    }
}

impl Check for View {
    fn check(&self) -> Result<(), Invalid> {
        self.number.check()?;
        self.tick.check()?;
        ascending(&self.members, |member| member.node, "view.members")?;
        let is_member = |node| self.members.iter().any(|member| member.node == node);
        must(is_member(self.leader), "view.leader", "a member")?;
        must(self.allocation.values().all(|&node| is_member(node)), "view.allocation", "to members")?;
        fit(&self.viewpoints, "view.viewpoints")?;
        suits(&self.allocation, &self.tree)
    }
}

/// Checks that a world can be looked at from these viewpoints.
fn fit(viewpoints: &[Viewpoint], what: &'static str) -> Result<(), Invalid> {
    must(viewpoints.iter().all(Viewpoint::is_fit), what, "finite, no radius negative")
}

/// Checks a tree, and that exactly its regions are allocated.
fn suits(allocation: &Allocation, tree: &DistributionTree) -> Result<(), Invalid> {
    must(tree.is_sound(), "tree", "connected, cut inside its cells and within its limits")?;
    must(allocation.keys().copied().eq(tree.leaves()), "allocation", "of the tree's regions")
}

impl Check for LoadReport {
    fn check(&self) -> Result<(), Invalid> {
        let fine = |v: f64| v.is_finite() && v >= 0.0;
        ascending(&self.regions, |region| region.region, "load.regions")?;
        must(self.regions.len() <= MAX_REGIONS, "load.regions", "at most 256")?;
        must(self.regions.iter().all(|r| fine(r.activity) && fine(r.step_us)), "load", "0 or more")?;
        for burden in &self.burdens {
            must(burden.place.iter().all(|v| v.is_finite()), "load.place", "finite")?;
            must(fine(burden.weight), "load.weight", "0 or more")?;
            must(burden.island.is_none_or(|i| i < self.islands.len()), "load.island", "one of its islands")?;
        }
        must(self.islands.iter().all(Bounds::is_finite), "load.islands", "finite boxes")
    }
}

impl Check for Chunk {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Shapes(shapes) => all(shapes),
            Self::Bodies(bodies) => all(bodies),
            Self::Placed(bodies) => all(bodies),
            Self::Joints(joints) => all(joints),
        }
    }
}

impl Check for Input {
    fn check(&self) -> Result<(), Invalid> {
        self.tick.check()?;
        self.velocity.check()?;
        self.drive.as_ref().map_or(Ok(()), Check::check)?;
        self.pose.map_or(Ok(()), |pose| pose.check())
    }
}

impl Check for WorldOp {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Insert { bodies, shapes, joints } => {
                all(bodies)?;
                all(shapes)?;
                all(joints)
            }
            // The member that applies it checks it against the tree.
            Self::Remove(_) | Self::RemoveJoint(_) | Self::ForgetShapes(_) | Self::Repartition(_) => Ok(()),
            Self::Input(input) => input.check(),
            Self::Push(push) => push.check(),
            Self::Alter(alteration) => alteration.check(),
            Self::Correct { tick, states, stuck } => {
                tick.check()?;
                all(states)?;
                ascending(stuck, |&body| body, "correct.stuck")
            }
            Self::Ask { question, .. } => question.check(),
            Self::Schedule(schedule) => {
                let Schedule { behind, behind_most, audit: _ } = schedule;
                must(behind.len() <= MAX_REGIONS, "schedule.behind", "at most all regions")?;
                ascending(behind, |&region| region, "schedule.behind")?;
                must(*behind_most < COARSEST, "schedule.behind_most", "at most 3")
            }
            Self::Watch(watch) => watch.check(),
        }
    }
}

impl Check for Watch {
    fn check(&self) -> Result<(), Invalid> {
        ascending(&self.areas, |(client, _)| *client, "watch.areas")?;
        ascending(&self.gone, |client| *client, "watch.gone")?;
        ascending(&self.avatars, |(avatar, _)| *avatar, "watch.avatars")?;
        let is_level = |(_, [level, ..]): &(_, [i64; 4])| (0..=MOST_LEVEL).contains(level);
        must(self.avatars.iter().all(is_level), "watch.avatars", "in cells of a level from 0 to 30")?;
        self.areas.iter().filter_map(|(_, area)| area.as_ref()).try_for_each(Check::check)
    }
}

impl Check for FidelityReport {
    fn check(&self) -> Result<(), Invalid> {
        let Self { error_m_s, low95_m_s, high95_m_s, share_of_full_time, .. } = *self;
        not_negative(&[error_m_s, low95_m_s, share_of_full_time as f32], "fidelity")?;
        // The upper end is infinite before there are two audits.
        must(high95_m_s >= 0.0, "fidelity.high95_m_s", "not negative")
    }
}

impl Check for RegionState {
    fn check(&self) -> Result<(), Invalid> {
        must(self.behind < COARSEST, "region.behind", "less than 4 ticks")?;
        let Signals { overlap_m, spin_rad_s } = self.signals;
        not_negative(&[overlap_m, spin_rad_s], "region.signals")?;
        let may_be = |v: f32| (0.0..=MOST_MS).contains(&v);
        must(self.times_ms().into_iter().all(may_be), "region.times_ms", "0 to 1e6")?;
        must(self.awake <= MOST_AWAKE, "region.awake", "at most 16,777,216")?;
        let Some(Audited { error_m_s, cost }) = self.audited else { return Ok(()) };
        let may_be = |v: f32| (0.0..=MOST_FOUND).contains(&v);
        must(may_be(error_m_s.unwrap_or(0.0)) && may_be(cost), "region.audited", "0 to 1e6")
    }
}

impl Check for Push {
    fn check(&self) -> Result<(), Invalid> {
        finite(&self.linear, "push.linear")?;
        finite(&self.angular, "push.angular")?;
        must(self.point.is_none_or(|point| point.iter().all(|v| v.is_finite())), "push.point", "finite")
    }
}

impl Check for Query {
    fn check(&self) -> Result<(), Invalid> {
        must(self.cost() <= MAX_COST, "query", "of 1024 rays, or what costs as much")?;
        must(self.fits(), "query", "short enough for a client's frame")?;
        must(self.filter.exclude.len() <= MAX_COST, "query.exclude", "at most 1024")?;
        ascending(&self.filter.exclude, |&body| body, "query.exclude")?;
        must(
            self.shapes.iter().all(ShapeRecord::suits_clients),
            "query.shapes",
            "neither meshes, terrain, voxels nor half-spaces",
        )?;
        all(&self.shapes)?;
        match &self.parts {
            QueryParts::Rays(rays) => all(rays),
            QueryParts::Casts(casts) => {
                let turns = casts.iter().any(|cast| cast.turn != [0.0; 3]);
                let small = self.shapes.iter().all(|shape| shape.largest_m() <= MAX_TURNING_M);
                must(!turns || small, "query.shapes", "within 100 m of their origins where one turns")?;
                all(casts)
            }
            QueryParts::Overlaps(overlaps) => all(overlaps),
        }
    }
}

impl Check for RayQuery {
    fn check(&self) -> Result<(), Invalid> {
        must(self.origin.iter().all(|v| v.is_finite()), "ray.origin", "finite")?;
        finite(&self.direction, "ray.direction")?;
        must(self.direction != [0.0; 3], "ray.direction", "longer than 0")?;
        must(self.max_m >= 0.0, "ray.max_m", "0 or more")
    }
}

impl Check for CastQuery {
    fn check(&self) -> Result<(), Invalid> {
        self.pose.check()?;
        within_reach(&self.motion, "cast.motion")?;
        let turn2: f32 = self.turn.iter().map(|v| v * v).sum();
        must(turn2 <= MAX_TURN * MAX_TURN, "cast.turn", "at most 64 radians")?;
        must((0.0..=SHAPE_REACH_M).contains(&self.margin_m), "cast.margin_m", "from 0 to 1e6 m")?;
        let is_plain = self.margin_m == 0.0 && !self.leaves;
        must(turn2 == 0.0 || is_plain, "cast.turn", "0 with a margin, or if it leaves what it starts in")
    }
}

impl Check for OverlapQuery {
    fn check(&self) -> Result<(), Invalid> {
        match &self.place {
            Place::Shape(_, pose) => pose.check(),
            Place::Point(point) => must(point.iter().all(|v| v.is_finite()), "overlap.point", "finite"),
            Place::Box(bounds) => {
                let in_order = (0..3).all(|i| bounds.min[i] <= bounds.max[i]);
                must(in_order, "overlap.box", "of corners in order")
            }
        }
    }
}

impl Check for RayAnswer {
    fn check(&self) -> Result<(), Invalid> {
        must(self.point.iter().all(|v| v.is_finite()), "answer.point", "finite")?;
        finite(&self.normal, "answer.normal")?;
        must(self.distance_m >= 0.0, "answer.distance_m", "0 or more")
    }
}

impl Check for CastAnswer {
    fn check(&self) -> Result<(), Invalid> {
        must(self.point.iter().all(|v| v.is_finite()), "answer.point", "finite")?;
        finite(&self.normal, "answer.normal")?;
        finite(&self.point_on_shape, "answer.point_on_shape")?;
        finite(&self.normal_on_shape, "answer.normal_on_shape")?;
        must((0.0..=1.0).contains(&self.fraction), "answer.fraction", "from 0 to 1")
    }
}

impl Check for QueryResult {
    fn check(&self) -> Result<(), Invalid> {
        let few = |count| must(count <= MAX_COST, "answer", "to at most 1024");
        match self {
            Self::Rays(hits) => {
                few(hits.len())?;
                hits.iter().flatten().try_for_each(Check::check)
            }
            Self::Casts(hits) => {
                few(hits.len())?;
                hits.iter().flatten().try_for_each(Check::check)
            }
            Self::Overlaps(lists) => {
                few(lists.len())?;
                must(lists.iter().map(Vec::len).sum::<usize>() <= MAX_FOUND, "answer", "of at most 4096")?;
                lists.iter().try_for_each(|list| ascending(list, |&found| found, "answer"))
            }
            Self::TooMuch => Ok(()),
        }
    }
}

impl Check for Dispatch {
    fn check(&self) -> Result<(), Invalid> {
        self.tick.check()?;
        must((1..=MAX_ROUNDS).contains(&self.rounds), "dispatch.rounds", "1 to 64")?;
        all(&self.ops)
    }
}

impl Check for Report {
    fn check(&self) -> Result<(), Invalid> {
        self.tick.check()?;
        all(&self.states)
    }
}

impl Check for Border {
    fn check(&self) -> Result<(), Invalid> {
        self.tick.check()?;
        all(&self.messages)
    }
}

impl Check for Done {
    fn check(&self) -> Result<(), Invalid> {
        self.tick.check()?;
        must((1..=MAX_ROUNDS).contains(&self.rounds_wanted), "done.rounds_wanted", "1 to 64")?;
        self.answers.iter().try_for_each(|answer| answer.found.check())?;
        self.load.as_ref().map_or(Ok(()), Check::check)?;
        must(self.regions.len() <= MAX_REGIONS, "done.regions", "at most all regions")?;
        ascending(&self.regions, |state| state.region, "done.regions")?;
        all(&self.regions)?;
        all(&self.events)
    }
}

impl Check for ToNode {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Welcome { world, .. } => world.check(),
            Self::Chunk(chunk) => chunk.check(),
            Self::Finish { dispatches, .. } => all(dispatches),
            Self::Adopt { view, .. } => view.check(),
            Self::Apply { ops, .. } => all(ops),
            Self::Ask { question, .. } => question.check(),
            Self::Look { viewpoints, .. } => fit(viewpoints, "viewpoints"),
            Self::Roster(members) => ascending(members, |member| member.node, "roster"),
            Self::InterGroup { tick, states, .. } => {
                tick.check()?;
                must(states.len() <= STATES_BYTES, "states", "no more than a datagram holds")
            }
            Self::Authority { stances, .. } => ascending(stances, |stance| stance.body, "stances"),
            Self::Settle { view } => view.check(),
            Self::Verify { view, nodes, .. } => {
                view.check()?;
                ascending(nodes, |verified| verified.node, "verify.nodes")
            }
            Self::WorldEnd | Self::Fetch { .. } | Self::Poll { .. } | Self::Shutdown { .. } => Ok(()),
        }
    }
}

impl Check for ToServer {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Settling { dispatches, undone, .. } => {
                all(dispatches)?;
                all(undone)
            }
            Self::Survey { tick, claims, division, .. } => {
                tick.check()?;
                claims.iter().try_for_each(|claim| claim.epoch.check())?;
                ascending(claims, |claim| claim.id, "survey.claims")?;
                division.iter().try_for_each(|(tree, allocation)| suits(allocation, tree))
            }
            Self::Repartitioned { tree, allocation, .. } => suits(allocation, tree),
            Self::Found { bodies, .. } => all(bodies),
            Self::Removed { tick, bodies, .. } => {
                tick.check()?;
                all(bodies)
            }
            Self::Checkpoint { tick, bodies, .. } => {
                tick.check()?;
                all(bodies)
            }
            Self::Answer { found, .. } => found.check(),
            Self::Contacts { events, .. } => {
                all(&events.touches)?;
                all(&events.forces)
            }
            Self::Delays(delays) => {
                ascending(delays, |delay| delay.node, "delays")?;
                delays.iter().try_for_each(|delay| not_negative(delay.delay_ms.as_slice(), "delay_ms"))
            }
            Self::Ballot { delay_ms, .. } => not_negative(delay_ms.as_slice(), "ballot.delay_ms"),
            Self::InterGroup { tick, states, .. } => {
                tick.check()?;
                must(states.len() <= STATES_BYTES, "states", "no more than a datagram holds")
            }
            Self::Fidelity { report, .. } => report.check(),
            Self::Touched { bodies, .. } => ascending(bodies, |&(body, _)| body, "touched"),
            Self::Verdict { view, tick, .. } => {
                view.check()?;
                tick.check()
            }
            Self::Loaded | Self::LinkLost { .. } | Self::Call(_) | Self::Leave => Ok(()),
        }
    }
}

impl Check for FromClient {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Input(input) => input.check(),
            Self::Spawn { body, shapes } => {
                body.check()?;
                all(shapes)
            }
            Self::Ask(question) => question.check(),
            Self::Interest(area) => area.map_or(Ok(()), |area| area.check()),
            Self::Introduce(ids) => {
                must(ids.len() <= MAX_INTRODUCED, "introduce", "at most 1,024 bodies at once")
            }
            Self::Heard(heard) => {
                must(heard.datagrams.len() <= MAX_HEARD, "heard", "at most 64 runs of datagrams at once")
            }
            Self::Build { ops, .. } => {
                must(ops.len() <= MAX_BUILD_OPS, "build", "at most 1,024 changes at once")?;
                all(ops)
            }
            Self::Despawn(_) | Self::Leave | Self::Untold => Ok(()),
        }
    }
}

impl Check for BuildOp {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Insert { bodies, shapes, joints } => {
                all(bodies)?;
                all(shapes)?;
                all(joints)
            }
            Self::Remove(_) | Self::RemoveJoint(_) => Ok(()),
            Self::Move(input) => input.check(),
            Self::Push(push) => push.check(),
            Self::Alter(alteration) => alteration.check(),
        }
    }
}

impl Check for Area {
    fn check(&self) -> Result<(), Invalid> {
        let is_there = self.centre.iter().all(|v| v.abs() <= WORLD_REACH_M);
        must(is_there, "interest.centre", "within a million kilometres")?;
        let is_size = self.radius_m > 0.0 && self.radius_m <= WORLD_REACH_M;
        must(is_size, "interest.radius_m", "above 0 and at most a million kilometres")
    }
}

impl Check for ToClient {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Welcome { world, .. } => world.check(),
            Self::Chunk(chunk) => chunk.check(),
            Self::Inserted { body, shapes, joints } => {
                body.check()?;
                all(shapes)?;
                all(joints)
            }
            Self::Altered(alteration) => alteration.check(),
            Self::States { stamp, states } => {
                stamp.tick.check()?;
                all(states)
            }
            // The process that takes the states in unpacks and checks them.
            Self::CompactStates { stamp, .. } => stamp.tick.check(),
            Self::Answer { found, .. } => found.check(),
            Self::Contacts { tick, touches, forces } => {
                tick.check()?;
                all(touches)?;
                all(forces)
            }
            Self::LeaderIs { tree: Some(tree), allocation, .. } | Self::Regions { tree, allocation } => {
                suits(allocation, tree)
            }
            Self::WorldEnd
            | Self::LeaderIs { .. }
            | Self::Removed(_)
            | Self::JointRemoved(_)
            | Self::ShapesGone(_)
            | Self::Built(_)
            | Self::ToldBy(_)
            | Self::Rejected { .. } => Ok(()),
        }
    }
}

impl Check for ToRelay {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Expect { view, clients } => {
                view.check()?;
                ascending(clients, |&client| client, "relay.expect")
            }
            Self::News(news) => {
                news.view.check()?;
                news.tick.check()?;
                ascending(&news.clients, |&(client, _)| client, "relay.clients")?;
                news.interests.iter().try_for_each(|(_, area)| area.map_or(Ok(()), |area| area.check()))
            }
            Self::Guess { view, tick, .. } => {
                view.check()?;
                tick.check()
            }
        }
    }
}

impl Check for Program {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Message(bytes) => {
                must(bytes.len() <= PROGRAM_MESSAGE_BYTES, "program.message", "32 KiB at most")
            }
            Self::Datagram(bytes) => {
                must(bytes.len() <= PROGRAM_DATAGRAM_BYTES, "program.datagram", "1 KiB at most")
            }
            Self::Taken(_) => Ok(()),
        }
    }
}

impl Check for Status {
    fn check(&self) -> Result<(), Invalid> {
        must(self.dt_s.is_finite() && self.dt_s > 0.0, "status.dt_s", "above 0")?;
        ascending(&self.groups, |group| group.group, "status.groups")?;
        ascending(&self.nodes, |node| node.node, "status.nodes")?;
        for group in &self.groups {
            ascending(&group.regions, |region| region.region, "status.regions")?;
            let finite = group.regions.iter().all(|region| region.bounds.is_finite());
            must(finite, "status.bounds", "finite boxes")?;
        }
        let delays = self.nodes.iter().filter_map(|node| node.delay_ms);
        not_negative(&delays.collect::<Vec<_>>(), "status.delay_ms")
    }
}

impl Check for Message {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::ToNode(message) => message.check(),
            Self::ToServer(message) => message.check(),
            Self::Dispatch(dispatch) => dispatch.check(),
            Self::Done(done) => done.check(),
            Self::Report(report) => report.check(),
            Self::Border(border) => border.check(),
            Self::FromClient(client, message) => {
                must(client.0 != 0, "client", "a client's id, from 1")?;
                message.check()
            }
            Self::ToClient(_, message) => message.check(),
            Self::Program(program) => program.check(),
            Self::Status(status) => status.check(),
            Self::Hello(hello) => match &hello.role {
                JoinAs::Client { interest: Some(area), .. } => area.check(),
                _ => Ok(()),
            },
            Self::Testimony(testimony) => {
                testimony.tick.check()?;
                let fits = |heard: &HeardBorder| heard.round < MAX_ROUNDS;
                must(testimony.heard.iter().all(fits), "testimony.round", "below 64")?;
                must(testimony.heard.len() <= MOST_HEARD, "testimony.heard", "at most 65,536 messages")
            }
            Self::Copied { border, .. } => border.check(),
            Self::Relay(message) => message.check(),
            Self::Linked { view, .. } | Self::Fed { view, .. } => view.check(),
            Self::Waiting(_) | Self::Ping(_) | Self::Pong(_) | Self::AskStatus => Ok(()),
        }
    }
}
