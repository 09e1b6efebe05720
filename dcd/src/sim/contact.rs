//! Provides small scenes for trials over Rapier: a stack, a chain and a crowd, with borders through bodies
//! that touch.

use std::fmt;
use std::str::FromStr;

use super::rapier::mechanics_of;
use super::{Course, Look, Quantity, Random, RapierEngine, Ruler, Sim, SimConfig, Strain, Watch, sim_world};
use crate::cluster::Record;
use crate::physics::{Measured, Partition, RegionHost, ShapeLibrary};
use crate::protocol::{BodyRecord, Coupling, EnvironmentProperties, JointRecord};
use crate::scene::{Params, Scene};
use crate::space::{Bounds, DistributionTree, Tick};

/// How many times its value in the undisturbed world each quantity may have.
const FACTOR: f64 = 3.0;
/// The radius of the balls of a gas, metres.
const BALL_M: f64 = 0.25;

/// A scene whose bodies touch across borders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactScene {
    /// Four stacks of five boxes, two of which stand on a border and one on the corner of four regions.
    Stack,
    /// A chain that swings through a border.
    Chain,
    /// Elastic balls that meet everywhere in a closed box.
    Crowd,
}

impl ContactScene {
    /// All scenes.
    pub const ALL: [Self; 3] = [Self::Stack, Self::Chain, Self::Crowd];

    /// Returns the name of the scene.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stack => "stack",
            Self::Chain => "chain",
            Self::Crowd => "crowd",
        }
    }

    /// Returns a short description of the scene.
    pub const fn summary(self) -> &'static str {
        match self {
            Self::Stack => "four stacks of five boxes, three of them on borders",
            Self::Chain => "a chain of twelve links and a bob, which swings through a border",
            Self::Crowd => "thirty elastic balls that meet everywhere in a box of eight regions",
        }
    }

    /// Returns the function that begins a trial with the scene.
    pub const fn begin(self) -> fn(SimConfig) -> Sim {
        match self {
            Self::Stack => |config| Self::Stack.cluster(config),
            Self::Chain => |config| Self::Chain.cluster(config),
            Self::Crowd => |config| Self::Crowd.cluster(config),
        }
    }

    /// Starts a cluster with the scene, and a watch over it.
    fn cluster(self, config: SimConfig) -> Sim {
        let content = self.content(&config);
        let watch = content.watch(&config);
        let Content { world, shapes, bodies, joints, .. } = content;
        let mut sim = Sim::with_world(
            config,
            world,
            Record::new(bodies, shapes.records(), joints),
            RapierEngine::boxed,
        );
        sim.watch(watch);
        sim
    }

    fn content(self, config: &SimConfig) -> Content {
        let scene = Scene { dt_s: config.dt_s, ..self.scene(config.seed) };
        let mut shapes = ShapeLibrary::default();
        let (bodies, joints) = scene.records(&mut shapes).expect("the shapes of the library are sound");
        let (mut settings, mut ahead_m) = (scene.step_settings(), None);
        if config.protocol.lag_ticks() > 0 {
            // Out of step no other coupling works, and a server refuses all others. It shares what may come near before
            // others hear of it.
            settings = settings.with_coupling(Coupling::Owner);
            ahead_m = Some(
                f64::from(sim_world(1).avatar_speed_limit * config.dt_s) * config.protocol.lag_ticks() as f64,
            );
        }
        let mut step = settings.record();
        if Random::new(config.seed ^ 0x5917_0000_0000_0000).chance(0.5) {
            // Half of the runs divide bodies that touch among regions, instead of moving them to one.
            step.island_limit = 2;
        }
        let tree = DistributionTree::halved(scene.bounds, config.regions).expect("a small number of regions");
        let world = EnvironmentProperties { step, tree, halo_m: None, ..sim_world(1) };
        let mut content = Content { of: self, world, shapes, bodies, joints };
        content.world.halo_m = ahead_m.map(|ahead_m| content.host().partition().halo_m() + ahead_m);
        content
    }

    fn scene(self, seed: u64) -> Scene {
        let (name, params) = match self {
            Self::Stack => ("pile", Params::new().with("n", 20).with("height", 5)),
            Self::Chain => {
                ("chain", Params::new().with("links", 12).with("bob_mass_ratio", 4).with("offset", 3))
            }
            Self::Crowd => ("gas", Params::new().with("n", 30).with("seed", seed)),
        };
        let scene = Scene::named(name, &params).expect("the scene is one of the library");
        let bounds = match self {
            // The grid of stacks has a pitch of 1.5 m, and the middle of the world is the middle of one
            // stack.
            Self::Stack => Bounds::around([0.75, 2.5, 0.75], [4.0; 3]),
            Self::Chain => Bounds::around([0.0, -3.0, 0.0], [5.0, 4.0, 4.0]),
            Self::Crowd => scene.bounds,
        };
        Scene { bounds, ..scene }
    }

    /// Returns for how long the undisturbed world is looked at, seconds. Stacks that never sleep go on
    /// sinking; all other bodies soon show what they do.
    const fn undisturbed_s(self) -> f32 {
        match self {
            Self::Stack => 60.0,
            Self::Chain | Self::Crowd => 20.0,
        }
    }
}

/// The content of a scene's world.
struct Content {
    of: ContactScene,
    world: EnvironmentProperties,
    shapes: ShapeLibrary,
    bodies: Vec<BodyRecord>,
    joints: Vec<JointRecord>,
}

impl Content {
    /// Creates the watch over a run. Its gates come from the same world in one process, cut into the same
    /// regions and never disturbed, since what borders alone do is not the effect of a fault.
    fn watch(&self, config: &SimConfig) -> Watch {
        let mut host = self.host();
        let dt_s = self.world.step.dt_s;
        let start_j = host.energy_j();
        let ruler = Ruler::new(dt_s, &self.bodies, &self.joints).with_energy(start_j, start_j.abs());
        let is_free = config.protocol.lag_ticks() == 0 && config.thresholds.delay.is_none();
        let ruler = match self.of {
            ContactScene::Stack => ruler.standing(),
            // Bodies that are late or corrected do not fly freely.
            ContactScene::Crowd if is_free => ruler.flying(self.world.tree.bounds(), BALL_M),
            ContactScene::Chain | ContactScene::Crowd => ruler,
        };
        let (mut worst, mut course) = (Strain::default(), Course::default());
        for tick in 1..(self.of.undisturbed_s() / dt_s) as u64 {
            host.step().expect("what is simulated fits");
            host.clear_events();
            let look = self.look(&host);
            worst = worst.or_worse(ruler.of_place(&look)).or_worse(course.follow(&ruler, Tick(tick), look));
        }
        let allowed = |quantity| allowance(quantity, config, f64::from(self.world.step.tolerance_m_s));
        Watch::new(ruler, Strain::each(|quantity| FACTOR * worst.of(quantity) + allowed(quantity)))
    }

    fn host(&self) -> RegionHost {
        let EnvironmentProperties { tree, halo_m, step, .. } = &self.world;
        let regions: Vec<_> = tree.leaves().collect();
        let partition = Partition::new(tree.clone(), *halo_m);
        let mut host =
            RegionHost::new(partition, (*step).into(), 1, &regions).expect("one thread can be had");
        for shape in self.shapes.records() {
            host.shapes_mut().add(shape).expect("the shapes of the library are sound");
        }
        host.insert(self.bodies.clone(), &self.joints).expect("the bodies of the library are sound");
        host
    }

    fn look(&self, host: &RegionHost) -> Look {
        let states = host.owned_bodies().map(|(id, region, handle)| (id, region.body_state(handle)));
        Look { bodies: states.collect(), mechanics: mechanics_of(host) }
    }
}

/// Returns how much of a quantity is allowed beyond what the undisturbed world shows.
fn allowance(quantity: Quantity, config: &SimConfig, tolerance_m_s: f64) -> f64 {
    let dt_s = f64::from(config.dt_s);
    let late_s = config.protocol.lag_ticks() as f64 * dt_s;
    // A late body is where its velocity would have brought it, off by ½ a t². The end of a chain feels twice
    // gravity.
    let late_m = 9.81 * late_s * late_s;
    // Bodies of another group are followed only from this distance on.
    let apart_m = config.thresholds.delay.map_or(0.0, |_| f64::from(config.thresholds.between_groups_m));
    match quantity {
        Quantity::Overlap | Quantity::Stray | Quantity::Gap => 0.005 + late_m + apart_m,
        // Velocities are wrong until late messages are heard, or while groups are brought together again.
        Quantity::Gain if late_m + apart_m > 0.0 => 0.25,
        Quantity::Gain => 0.05,
        Quantity::Push => tolerance_m_s,
        Quantity::Leap => tolerance_m_s * dt_s,
        // Few collisions at borders are one-sided, by some metres per second, with and without faults, and
        // not the same ones in each run.
        Quantity::Drift => 4.0 * tolerance_m_s,
    }
}

impl fmt::Display for ContactScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ContactScene {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|scene| scene.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("there is no scene `{text}` for faults; choose one of {names}")
        })
    }
}
