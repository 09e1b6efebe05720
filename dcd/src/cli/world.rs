//! Configures a world from a scene and arguments, for every subcommand that makes one.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::failure::Failure;
use crate::physics::{Coupling, CouplingChoice, HostError, Method, Preset};
use crate::protocol::{BIG_ISLAND, MAX_DEPTH, MAX_ROUNDS};
use crate::runtime::{Partitioning, WorldConfig, WorldError};
use crate::scene::Scene;
use crate::space::{Axis, Balance, MAX_REGIONS, TreeError};

/// The most bodies of an island that one node of a served world owns whole.
const SERVED_ISLAND: usize = 256;

/// How the world is cut and how its regions agree.
#[derive(clap::Args)]
pub(super) struct CutArgs {
    /// Cut the whole world by a plane, as x=0 or y=2.5 (metres), instead of halving; may be given several
    /// times
    #[arg(long, value_name = "AXIS=VALUE", value_parser = plane)]
    cut: Vec<(Axis, f64)>,
    /// Let regions follow the load: their planes move so that all have equal shares. With a range, as 1-8,
    /// regions are also cut and merged as there is more or less to do
    #[arg(long, value_name = "LEAST-MOST", num_args = 0..=1, default_missing_value = "", value_parser = range)]
    balance: Option<Range>,
    /// How regions agree on the bodies that they share [default: what the scene says, else auto]
    #[arg(long, value_name = "NAME", value_parser = coupling())]
    coupling: Option<Coupling>,
    /// Substeps per tick, with an exchange between regions after each (for `auto` the most a border may take)
    /// [default: 1 for proxy and owner, 2 for overlap and island, 4 for auto]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_ROUNDS)))]
    exchanges: Option<u32>,
    /// Contact hops across a border within which bodies live in both regions [default: 2]
    #[arg(long, value_name = "HOPS", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_DEPTH)))]
    depth: Option<u32>,
    /// The most bodies of an island that moves whole to one region; 0 moves none [default: 65534, that is any
    /// island; 256 for a scene by `dcd serve`; at most 128 to 256 for a balanced world of `dcd run`]
    #[arg(long, value_name = "BODIES", value_parser = clap::value_parser!(u16).range(..=i64::from(BIG_ISLAND) - 1))]
    island_limit: Option<u16>,
    /// The disagreement of copies that `auto` tolerates, in metres per second [default: 0.03]
    #[arg(long, value_name = "M_S", value_parser = tolerance)]
    tolerance: Option<f32>,
    /// How much accuracy `auto` is asked for; sets the four options above, which still override it
    #[arg(long, value_name = "NAME", value_parser = preset(), conflicts_with = "coupling")]
    preset: Option<Preset>,
}

impl CutArgs {
    /// Returns the configuration of the world that the scene and the arguments ask for; `regions` are made by halving.
    fn config(&self, scene: &Scene, regions: Option<u16>) -> Result<WorldConfig, Failure> {
        let mut config = WorldConfig::for_scene(scene);
        if let Some(count) = regions {
            config.partitioning = Partitioning::Regions(count.into());
        }
        if !self.cut.is_empty() {
            for &(axis, at) in &self.cut {
                let (min, max) = (scene.bounds.min[axis.index()], scene.bounds.max[axis.index()]);
                if !(min < at && at < max) {
                    return Err(outside(axis, at, scene));
                }
            }
            config.partitioning = Partitioning::Cuts(self.cut.clone());
        }
        if let Some(Range(range)) = self.balance {
            let balance = config.balance.unwrap_or_default();
            let regions = config.tree_of(scene).map_err(|error| explained(error.into(), scene))?.leaf_count();
            let (least_regions, most_regions) = match (range, &config.partitioning) {
                (Some(range), _) => range,
                // As many regions as the scene says.
                (None, Partitioning::Auto) if config.balance.is_some() => {
                    (balance.least_regions, balance.most_regions)
                }
                (None, _) => (regions, regions),
            };
            config.balance = Some(Balance { least_regions, most_regions, ..balance });
        }
        config.step = self.choice().applied_to(config.step);
        Ok(config)
    }

    /// Returns the configuration of a world of this process. Fails if --balance is given for one region,
    /// which has nothing to be balanced with.
    pub(super) fn local_config(&self, scene: &Scene, regions: Option<u16>) -> Result<WorldConfig, Failure> {
        let config = self.config(scene, regions)?;
        if self.balance.is_some() && config.balance.is_some_and(|balance| balance.most_regions == 1) {
            return Err(Failure::usage(
                "--balance has one region here, and nothing to balance it with; say how many by --regions N, or from how many to \
                 how many, as --balance 1-8",
            ));
        }
        Ok(config)
    }

    /// Returns the configuration of a world that nodes share. Unless scene or options say otherwise, islands
    /// too large for one node are cut, and each node has a region.
    pub(super) fn served_config(&self, scene: &Scene, regions: Option<u16>) -> Result<WorldConfig, Failure> {
        let mut config = self.config(scene, regions)?;
        if self.island_limit.is_none() && scene.coupling.island_limit.is_none() {
            config.step.island_limit = config.step.island_limit.min(SERVED_ISLAND);
        }
        if let (Some(Range(None)), Partitioning::Auto) = (&self.balance, &config.partitioning) {
            config.balance = scene.balance;
        }
        Ok(config)
    }

    /// Returns the first of these options that was given, for commands that leave nothing to choose.
    pub(super) fn first_given(&self) -> Option<&'static str> {
        let given = [
            ("--cut", !self.cut.is_empty()),
            ("--balance", self.balance.is_some()),
            ("--coupling", self.coupling.is_some()),
            ("--exchanges", self.exchanges.is_some()),
            ("--depth", self.depth.is_some()),
            ("--island-limit", self.island_limit.is_some()),
            ("--tolerance", self.tolerance.is_some()),
            ("--preset", self.preset.is_some()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }

    fn choice(&self) -> CouplingChoice {
        CouplingChoice {
            method: self.preset.map(Method::Preset).or(self.coupling.map(Method::Coupling)),
            exchanges: self.exchanges.map(|exchanges| exchanges as usize),
            depth: self.depth.map(|depth| depth as usize),
            island_limit: self.island_limit.map(usize::from),
            tolerance_m_s: self.tolerance,
        }
    }
}

/// A range of region counts; `None` keeps the present count.
#[derive(Clone, Copy)]
struct Range(Option<(usize, usize)>);

fn range(text: &str) -> Result<Range, String> {
    let wrong = || format!("write the fewest and the most regions, as 1-8, each from 1 to {MAX_REGIONS}");
    if text.is_empty() {
        return Ok(Range(None));
    }
    let (least, most) = text.split_once('-').ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse().ok().filter(|n| (1..=MAX_REGIONS).contains(n));
    match (number(least), number(most)) {
        (Some(least), Some(most)) if least <= most => Ok(Range(Some((least, most)))),
        _ => Err(wrong()),
    }
}

fn preset() -> impl TypedValueParser<Value = Preset> {
    PossibleValuesParser::new(Preset::ALL.map(Preset::name)).map(|name| {
        let named = Preset::ALL.into_iter().find(|preset| preset.name() == name);
        named.expect("only names of presets get here")
    })
}

fn coupling() -> impl TypedValueParser<Value = Coupling> {
    PossibleValuesParser::new(Coupling::ALL.map(Coupling::name)).map(|name| {
        let named = Coupling::ALL.into_iter().find(|coupling| coupling.name() == name);
        named.expect("only names of couplings get here")
    })
}

fn tolerance(text: &str) -> Result<f32, String> {
    let wrong = || "write metres per second above 0, as 0.03".to_owned();
    let value: f32 = text.parse().map_err(|_| wrong())?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(wrong()) }
}

fn plane(text: &str) -> Result<(Axis, f64), String> {
    let wrong = || "write an axis and metres, as x=0 or y=2.5".to_owned();
    let (axis, at) = text.split_once('=').ok_or_else(wrong)?;
    let axis = match axis.trim() {
        "x" => Axis::X,
        "y" => Axis::Y,
        "z" => Axis::Z,
        _ => return Err(wrong()),
    };
    let at: f64 = at.trim().parse().map_err(|_| wrong())?;
    if at.is_finite() { Ok((axis, at)) } else { Err(wrong()) }
}

/// Returns why a scene cannot be made a world.
pub(super) fn explained(error: WorldError, scene: &Scene) -> Failure {
    match error {
        WorldError::Tree(TreeError::Plane { axis, at }) => outside(axis, at, scene),
        // Missing threads are the machine's fault; everything else is what the scene asks for.
        WorldError::Host(HostError::Threads { .. }) => error.into(),
        WorldError::Host(_) | WorldError::TooFast { .. } => {
            Failure::usage(format!("the scene `{}` cannot be: {error}", scene.name))
        }
        error => error.into(),
    }
}

fn outside(axis: Axis, at: f64, scene: &Scene) -> Failure {
    let millimetres = |corner: [f64; 3]| corner.map(|at| (1e3 * at).round() / 1e3);
    let (min, max) = (millimetres(scene.bounds.min), millimetres(scene.bounds.max));
    let [x, y, z] = [0, 1, 2].map(|i| format!("{} to {}", min[i], max[i]));
    Failure::usage(format!(
        "the plane {}={at} cuts no region of `{}`; give each plane once, within the world's bounds: x from {x}, y from {y}, z from {z}",
        ["x", "y", "z"][axis.index()],
        scene.name
    ))
}
