//! Runs the experiments of the thesis's chapter 5 again: cubes that move freely, and participants that each
//! compute a part of their world and steer one avatar in it; a server and up to 32 processes over QUIC.
//!
//! Times are processor times per tick, with all threads and the exchange. On a machine with fewer cores than
//! processes, the slowest member's time is what a tick would take on as many machines (the critical path),
//! without the way of messages.

mod group;
mod participant;
mod picture;
mod published;
mod tables;

use std::error::Error;
use std::time::Duration;

use clap::Args;
use dcd::runtime::{LocalWorld, WorldConfig};
use dcd::scene::{Params, Scene};
use serde::{Deserialize, Serialize};
use serde_json::json;

pub(crate) use self::participant::ThesisParticipant;

use self::group::{Group, Length};
use self::published::WORLDS;
use crate::output::{Output, Sheet, Shown};

const SHOWN: Shown<Row> = Shown { name: "thesis", table: tables::markdown, picture: Some(picture::picture) };
/// The numbers of nodes of tables 5.2 to 5.6, and (`LARGE_GROUPS`) of table 5.7.
const GROUPS: [usize; 8] = [1, 2, 3, 4, 5, 6, 7, 8];
const LARGE_GROUPS: [usize; 2] = [16, 32];
/// The ticks over which collisions are counted.
const COUNTED: usize = 120;

/// Which worlds are run, and how often.
#[derive(Args)]
pub(crate) struct Thesis {
    #[command(flatten)]
    output: Output,
    /// Prints one JSON object last.
    #[arg(long)]
    json: bool,
    /// Runs each group this often; the mean counts, as in the thesis.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: u16,
    /// Only worlds of this many cubes; rows of others stay in the file. May be given several times.
    #[arg(long, value_name = "CUBES")]
    objects: Vec<usize>,
    /// Only groups of this many nodes. May be given several times.
    #[arg(long, value_name = "NODES")]
    nodes: Vec<usize>,
}

/// One group in one world: means of the repeats.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    objects: usize,
    nodes: usize,
    repeats: u16,
    /// Processor time, milliseconds per tick: of the leader; the mean of all members; of the slowest.
    leader_ms: f64,
    members_ms: f64,
    slowest_ms: f64,
    /// Wall time, milliseconds per tick.
    wall_ms: f64,
    /// Messages and bytes sent by a member in a tick.
    messages: f64,
    bytes: f64,
    /// Copies of others' bodies at a member.
    ghosts: f64,
    /// Exchanges in a tick: those of the border that takes most.
    exchanges: f64,
    /// The largest disagreement of copies at borders, m/s.
    disagreement_m_s: f32,
    /// Pairs that touch in a tick, in a world in one process.
    collisions: f64,
}

impl Thesis {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let rows = self.output.fill(&SHOWN, |rows| self.measure(rows))?;
        if self.json {
            println!("{}", json!({ "rows": tables::compared(&rows) }));
        }
        Ok(())
    }

    /// Lists the worlds and groups to be run.
    fn plan(&self) -> Vec<(usize, usize)> {
        if self.output.quick && self.objects.is_empty() && self.nodes.is_empty() {
            return vec![(500, 1), (500, 2)];
        }
        let mut plan = Vec::new();
        for world in &WORLDS {
            let groups = GROUPS.into_iter().filter(|&nodes| nodes == 1 || world.groups.is_some());
            let large = LARGE_GROUPS.into_iter().filter(|_| world.large.is_some() || world.objects == 4_000);
            plan.extend(groups.chain(large).map(|nodes| (world.objects, nodes)));
        }
        // Worlds beyond the thesis, where there is more to compute than to send.
        plan.extend([1, 8, 32].map(|nodes| (MANY, nodes)));
        let wanted = |of: &[usize], value| of.is_empty() || of.contains(&value);
        plan.retain(|&(objects, nodes)| wanted(&self.objects, objects) && wanted(&self.nodes, nodes));
        plan
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        if !self.output.quick {
            rows.recall()?;
        }
        let plan = self.plan();
        if plan.is_empty() {
            return Err("the thesis had no such world or group; see `thesis --help`".into());
        }
        let repeats = if self.output.quick { 1 } else { self.repeats };
        let length = match self.output.quick {
            true => Length { ticks: 150, time: Duration::from_millis(500) },
            false => Length { ticks: 600, time: Duration::from_secs(3) },
        };
        for (i, &(objects, nodes)) in plan.iter().enumerate() {
            eprintln!("{}/{}: {objects} cubes, {nodes} nodes", i + 1, plan.len());
            let groups: Result<Vec<Group>, _> = (0..repeats)
                .map(|repeat| group::run(nodes, objects, 1 + u64::from(repeat), length))
                .collect();
            let row = row(objects, nodes, &groups?, collisions(objects)?);
            let fresh = rows.measured(row);
            rows.replace(|old| (old.objects, old.nodes) == (objects, nodes), [fresh])?;
        }
        Ok(())
    }
}

/// More cubes than the thesis had.
const MANY: usize = 20_000;

fn row(objects: usize, nodes: usize, groups: &[Group], collisions: f64) -> Row {
    let mean = |of: &dyn Fn(&Group) -> f64| groups.iter().map(of).sum::<f64>() / groups.len() as f64;
    let members = |of: fn(&participant::Report) -> f64| {
        mean(&|group| group.members.iter().map(of).sum::<f64>() / group.members.len() as f64)
    };
    let leader = |group: &Group| {
        let leads = group.members.iter().find(|member| member.node == group.leader);
        leads.map_or(f64::NAN, |leader| leader.cpu_ms)
    };
    let all = groups.iter().flat_map(|group| &group.members);
    Row {
        objects,
        nodes,
        repeats: groups.len() as u16,
        leader_ms: mean(&leader),
        members_ms: members(|member| member.cpu_ms),
        slowest_ms: mean(&|group| group.members.iter().map(|member| member.cpu_ms).fold(0.0, f64::max)),
        wall_ms: members(|member| member.wall_ms),
        messages: members(|member| member.messages),
        bytes: members(|member| member.bytes),
        ghosts: members(|member| member.ghosts),
        exchanges: members(|member| member.exchanges),
        disagreement_m_s: all.map(|member| member.disagreement_m_s).fold(0.0, f32::max),
        collisions,
    }
}

/// Returns the mean number of pairs of cubes that touch in a tick, in a world in one process.
fn collisions(objects: usize) -> Result<f64, Box<dyn Error>> {
    let scene = Scene::named("dve", &Params::new().with("n", objects))?;
    let mut world = LocalWorld::from_scene(&scene, WorldConfig::for_scene(&scene))?;
    let mut touching = 0;
    for _ in 0..COUNTED {
        world.step()?;
        let pairs = world.regions().flat_map(|region| region.physics().narrow_phase.contact_pairs());
        touching += pairs.filter(|pair| pair.has_any_active_contact()).count();
    }
    Ok(touching as f64 / COUNTED as f64)
}
