//! Defines the settings of a world (its box, cut, threads and steps), and the errors of a local one.

use super::choice;
use crate::fidelity::Fidelity;
use crate::physics::{ControlError, HostError, StepSettings};
use crate::protocol::{BodyKind, BodyRecord};
use crate::scene::Scene;
use crate::space::{Axis, Balance, BodyId, Bounds, DistributionTree, JointId, TreeError, Viewpoint};

/// The way in which a world is cut into regions.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Partitioning {
    /// As few regions as suffice: one, on all threads, which is exact. A world that is made from a scene gets
    /// more if its movable bodies lie more than 32 km apart, since f32 would not give one region millimetres.
    #[default]
    Auto,
    /// This many regions, 1 to 256, by halving the largest region again and again across its longest axis.
    /// The axis along which gravity pulls most is cut only if no other can be halved, since a level cut goes
    /// through what lies on the ground.
    Regions(usize),
    /// This many regions, 1 to 256, by planes across these axes alone.
    RegionsAcross(usize, Vec<Axis>),
    /// Regions between these planes (metres in world space), each of which goes through the whole world.
    Cuts(Vec<(Axis, f64)>),
}

/// The settings of a local world. They are also those of a world that is served from a scene
/// (`World::serve`), where all but `threads` count.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldConfig {
    /// The box that is cut into regions, in metres. Bodies may leave it: the cells of outer regions reach to
    /// infinity.
    pub bounds: Bounds,
    /// How the world is cut.
    pub partitioning: Partitioning,
    /// The number of threads that step the world, 1 to 1,024. With the feature `parallel` one region uses all
    /// of them, otherwise at most as many work as there are regions. 1 uses the calling thread, as a world of
    /// few awake bodies does anyhow. Results do not depend on it.
    pub threads: usize,
    /// The halo in metres, 0 or more: how far beyond its cell a region holds ghosts (copies of other regions'
    /// bodies). `None` follows the largest body.
    pub halo_m: Option<f64>,
    /// How regions follow the load; `None` leaves them as they are cut. If the world is served and cut by
    /// [`Partitioning::Auto`], `None` gives it one region for each node: [`Balance::by_nodes`].
    pub balance: Option<Balance>,
    /// How much of the world is computed in full. The couplings `owner` and `proxy`, and a served world with
    /// a lag, allow only [`Fidelity::Off`].
    pub fidelity: Fidelity,
    /// How the world is stepped.
    pub step: StepSettings,
}

impl Default for WorldConfig {
    fn default() -> Self {
        Self {
            bounds: Bounds::around([0.0; 3], [64.0; 3]),
            partitioning: Partitioning::Auto,
            threads: 1,
            halo_m: None,
            balance: None,
            fidelity: Fidelity::Off,
            step: StepSettings::default(),
        }
    }
}

impl WorldConfig {
    /// Returns the configuration that a scene asks for, including its coupling, on one thread.
    #[must_use]
    pub fn for_scene(scene: &Scene) -> Self {
        Self {
            bounds: scene.bounds,
            partitioning: match scene.regions {
                _ if !scene.cuts.is_empty() => Partitioning::Cuts(scene.cuts.clone()),
                Some(count) => Partitioning::Regions(count),
                None => Partitioning::Auto,
            },
            threads: 1,
            halo_m: None,
            balance: scene.balance,
            fidelity: scene.fidelity,
            step: scene.step_settings(),
        }
    }

    /// Checks that every setting is in range; the error names the first one that is not.
    pub fn check(&self) -> Result<(), WorldError> {
        check(self)
    }

    /// Returns the distribution tree that this configuration asks for; with [`Partitioning::Auto`] that of a world without
    /// bodies.
    #[doc(hidden)]
    pub fn tree(&self) -> Result<DistributionTree, TreeError> {
        match &self.partitioning {
            Partitioning::Auto => DistributionTree::halved(self.bounds, 1),
            Partitioning::Regions(count) => {
                let upright = upright_axes(self.step.gravity);
                match DistributionTree::halved_across(self.bounds, *count, &upright) {
                    Err(TreeError::Limits(_)) => DistributionTree::halved(self.bounds, *count),
                    cut => cut,
                }
            }
            Partitioning::RegionsAcross(count, axes) => {
                DistributionTree::halved_across(self.bounds, *count, axes)
            }
            Partitioning::Cuts(planes) => DistributionTree::cut_by(self.bounds, planes),
        }
    }

    /// Returns the distribution tree of a world that is made of a scene by this configuration.
    pub(crate) fn tree_of(&self, scene: &Scene) -> Result<DistributionTree, TreeError> {
        match self.partitioning {
            Partitioning::Auto => choice::tree_for(scene, self.bounds),
            _ => self.tree(),
        }
    }
}

/// The error of a local world.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The world cannot be cut into regions as asked.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// A body, shape or joint is refused.
    #[error(transparent)]
    Host(#[from] HostError),
    /// A character or vehicle controller cannot work.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A setting is out of range.
    #[error("{what} is {value}: {range}")]
    Setting {
        /// The name of the setting.
        what: &'static str,
        /// The value.
        value: String,
        /// The values that are allowed.
        range: &'static str,
    },
    /// The world has no such body.
    #[error("{0} is not in the world: it was removed, or its id belongs to another world")]
    NoBody(BodyId),
    /// A dynamic body is to be faster than the world's speed limit.
    #[error(
        "{body} is to move at {speed_m_s} m/s, and what the solver moves here is cut to {limit_m_s} m/s: make it slower, or make the world with a higher speed limit"
    )]
    TooFast {
        /// The body.
        body: BodyId,
        /// The speed asked for, m/s.
        speed_m_s: f32,
        /// The world's speed limit, m/s ([`StepSettings::speed_limit_m_s`]).
        limit_m_s: f32,
    },
    /// The body is no character.
    #[error("{0} is no character; insert it by World::insert_character")]
    NoCharacter(BodyId),
    /// The body is no vehicle.
    #[error("{0} is no vehicle; insert it by World::insert_vehicle")]
    NoVehicle(BodyId),
    /// The body has no such collider.
    #[error("{body} has {count} colliders, there is none of index {index}; count from 0")]
    NoCollider {
        /// The body.
        body: BodyId,
        /// The index asked for, counted from 0.
        index: usize,
        /// The number of colliders that the body has.
        count: usize,
    },
    /// The world has no such joint.
    #[error("{0} is not in the world: it was removed, or one of its bodies was")]
    NoJoint(JointId),
    /// The checkpoint is of another world.
    #[error(
        "the checkpoint is of another world: go back to one that this world's own checkpoint() made, or move worlds by save() and reload()"
    )]
    OtherWorld,
    /// All ids of bodies are used up.
    #[error("the world has given all 4,294,967,295 body ids")]
    Full,
}

/// Refuses a dynamic body that is faster than the solver would let it be. What was read from a body that is at the limit may be above it
/// by rounding.
pub(crate) fn check_speed(body: &BodyRecord, limit_m_s: f32) -> Result<(), WorldError> {
    let velocity = &body.state.velocity;
    if body.traits.kind != BodyKind::Dynamic || velocity.is_within(limit_m_s * 1.000_01) {
        return Ok(());
    }
    let speed_m_s = velocity.linear.iter().map(|v| v * v).sum::<f32>().sqrt();
    Err(WorldError::TooFast { body: body.id, speed_m_s, limit_m_s })
}

/// Returns the axes other than the one along which gravity pulls most: all where there is none.
fn upright_axes(gravity: [f32; 3]) -> Vec<Axis> {
    let pull = |axis: Axis| gravity[axis.index()].abs();
    let pulled = Axis::ALL.into_iter().filter(|&axis| pull(axis) > 0.0);
    let down = pulled.max_by(|&a, &b| pull(a).total_cmp(&pull(b)));
    Axis::ALL.into_iter().filter(|&axis| Some(axis) != down).collect()
}

fn check(config: &WorldConfig) -> Result<(), WorldError> {
    let wrong = |what, value: String, range| Err(WorldError::Setting { what, value, range });
    if let Some((what, value, range)) = config.step.fault() {
        return wrong(what, value, range);
    }
    if let Some((what, value, range)) = config.balance.as_ref().and_then(Balance::fault) {
        return wrong(what, value, range);
    }
    if let Some((what, value, range)) = config.fidelity.fault() {
        return wrong(what, value, range);
    }
    let coupling = config.step.coupling;
    if config.fidelity != Fidelity::Off && !coupling.shares_mass() {
        let range = "off with the couplings owner and proxy: leave it out, or take another coupling";
        return wrong("fidelity", config.fidelity.to_string(), range);
    }
    check_threads(config.threads)?;
    if config.halo_m.is_some_and(|halo| !halo.is_finite() || halo < 0.0) {
        return wrong("halo_m", format!("{:?}", config.halo_m), "a number of metres, 0 or more");
    }
    Ok(())
}

/// Checks that a world can be looked at from there.
pub(super) fn check_viewpoints(viewpoints: &[Viewpoint]) -> Result<(), WorldError> {
    match viewpoints.iter().find(|viewpoint| !viewpoint.is_fit()) {
        None => Ok(()),
        Some(unfit) => {
            let (what, range) = ("viewpoint", "finite numbers, and a radius of 0 or more");
            Err(WorldError::Setting { what, value: format!("{unfit:?}"), range })
        }
    }
}

pub(super) fn check_threads(threads: usize) -> Result<(), WorldError> {
    if !(1..=1024).contains(&threads) {
        let (what, range) = ("threads", "1 to 1024 threads");
        return Err(WorldError::Setting { what, value: threads.to_string(), range });
    }
    Ok(())
}
