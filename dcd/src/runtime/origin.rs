//! Makes the beginning of a served world from a scene, or from a world in this process.

use super::config::check_speed;
use super::links::WORLD_BYTES;
use super::saved::contents;
use super::{LocalWorld, Partitioning, ProcessError, ServeConfig, Why, WorldConfig, WorldError};
use crate::cluster::Record;
use crate::fidelity::Fidelity;
use crate::physics::{Coupling, Partition, RegionHost, ShapeError, ShapeLibrary, StepSettings};
use crate::protocol::{
    BodyKind, BodyRecord, EnvironmentProperties, JointRecord, MAX_STATE_TICKS, ShapeRecord, SyncProtocol,
    encoded_len,
};
use crate::scene::Scene;
use crate::space::{Balance, DistributionTree, Epoch, Viewpoint};

/// The origin of a served world: a scene, or a copy of a local world.
pub enum Origin<'a> {
    /// A scene. All of the configuration counts but `threads`.
    Scene(&'a Scene, &'a WorldConfig),
    /// A world as it is now, copied with its cut and settings. Only the properties of bodies and joints are
    /// copied: contacts under load begin anew, and the tick begins at 0.
    World(&'a LocalWorld),
}

/// The initial state of a served world.
pub(crate) struct Beginning {
    tree: DistributionTree,
    balance: Option<Balance>,
    halo_m: Option<f64>,
    step: StepSettings,
    fidelity: Fidelity,
    viewpoints: Vec<Viewpoint>,
    shapes: Vec<ShapeRecord>,
    bodies: Vec<BodyRecord>,
    joints: Vec<JointRecord>,
}

impl Beginning {
    pub(crate) fn of(origin: Origin<'_>) -> Result<Self, ProcessError> {
        match origin {
            Origin::Scene(scene, config) => {
                config.check()?;
                let mut shapes = ShapeLibrary::default();
                let (bodies, joints) = scene.records(&mut shapes)?;
                let (tree, halo_m, step) = (config.tree_of(scene)?, config.halo_m, config.step);
                let is_uncut = matches!(config.partitioning, Partitioning::Auto);
                let balance = config.balance.or_else(|| is_uncut.then(|| by_nodes(&tree)));
                let (fidelity, viewpoints) = (config.fidelity, scene.viewpoints.clone());
                let shapes = shapes.records();
                Ok(Self { tree, balance, halo_m, step, fidelity, viewpoints, shapes, bodies, joints })
            }
            Origin::World(world) => {
                let host = world.host();
                let (mut bodies, shapes, mut joints) = contents(world);
                // Avatars of a saved world belong to clients that this world does not know.
                bodies.retain(|body| body.id.client().is_none());
                joints.retain(|joint| [joint.a, joint.b].iter().all(|id| id.client().is_none()));
                // Its owner in the other world means nothing in this one.
                bodies.iter_mut().for_each(|body| body.epoch = Epoch(0));
                let tree = host.partition().tree().clone();
                let is_cut = match world.chosen().why {
                    Why::Asked => true,
                    // A save does not say who cut the world; nobody cut a world of one region.
                    Why::Saved => tree.leaf_count() > 1,
                    _ => false,
                };
                Ok(Self {
                    balance: host.balance().copied().or_else(|| (!is_cut).then(|| by_nodes(&tree))),
                    tree,
                    // An empty world has no halo unless it was given one.
                    halo_m: Some(host.partition().halo_m()).filter(|halo_m| *halo_m > 0.0),
                    step: host.asked_settings(),
                    fidelity: host.fidelity(),
                    viewpoints: host.viewpoints().to_vec(),
                    shapes,
                    bodies,
                    joints,
                })
            }
        }
    }
}

/// Returns the balance by which a world that nobody cut follows its nodes. It has no fewer regions than it
/// begins with: one, or as many as keep millimetres in f32.
fn by_nodes(tree: &DistributionTree) -> Balance {
    let (least_regions, by_nodes) = (tree.leaf_count(), Balance::by_nodes());
    Balance { least_regions, most_regions: by_nodes.most_regions.max(least_regions), ..by_nodes }
}

/// Returns the properties of the world as sent to all processes, and its record. The halo is that of a local
/// world with the same bodies, so that both compute the same bits.
pub(super) fn world_of(
    beginning: Beginning,
    config: &ServeConfig,
) -> Result<(EnvironmentProperties, Record), ProcessError> {
    let Beginning { tree, balance, halo_m, step, fidelity, viewpoints, shapes, bodies, joints } = beginning;
    if !(1..=MAX_STATE_TICKS).contains(&config.state_every) {
        let (what, range) = ("state_every", "a number of ticks from 1 to 30");
        return Err(WorldError::Setting { what, value: config.state_every.to_string(), range }.into());
    }
    if !(0.0..=1.0).contains(&config.verify) {
        let (what, range) = ("verify", "a share of the participants from 0 to 1");
        return Err(WorldError::Setting { what, value: config.verify.to_string(), range }.into());
    }
    if config.verify > 0.0 && config.groups.lag_ticks > 0 {
        let range = "leave it 0 where members run ahead of one another (--lag): what one was told in which tick is not known then";
        return Err(WorldError::Setting { what: "verify", value: config.verify.to_string(), range }.into());
    }
    if !step.can_be_served() {
        let range = "a served world is stepped with Rapier's own parameters: leave all but the speed limit at their defaults";
        let (what, value) = ("step.integration", "changed".to_owned());
        return Err(WorldError::Setting { what, value, range }.into());
    }
    bodies.iter().try_for_each(|body| check_speed(body, step.speed_limit_m_s()))?;
    let mut host = RegionHost::new(Partition::new(tree.clone(), halo_m), step, 1, &[])?;
    for record in &shapes {
        if !record.can_travel() {
            return Err(ShapeError::TooLong.into());
        }
        host.shapes_mut().add(record.clone())?;
    }
    let shape_bytes: usize = shapes.iter().map(encoded_len).sum();
    if shape_bytes > WORLD_BYTES {
        return Err(ShapeError::TooMany(shape_bytes >> 20).into());
    }
    host.insert(bodies.clone(), &joints)?;
    let record = Record::new(bodies, shapes, joints);
    let lag_ticks = config.groups.lag_ticks;
    if lag_ticks > 0 && step.coupling != Coupling::Owner {
        return Err(ProcessError::Lag { coupling: step.coupling.name() });
    }
    if lag_ticks > 0 && fidelity != Fidelity::Off {
        let range = "off where members run ahead of one another (--lag): regions that share bodies must be at one time";
        return Err(WorldError::Setting { what: "fidelity", value: format!("{fidelity:?}"), range }.into());
    }
    let protocol = match lag_ticks {
        0 => SyncProtocol::Synchronised,
        lag_ticks => SyncProtocol::Unsynchronised { lag_ticks },
    };
    // With lag bodies are sent later, so the halo must reach farther ahead.
    let ahead_m = f64::from(config.avatar_speed_limit * step.dt_s) * f64::from(lag_ticks);
    // A world that its program fills later has the halo of what comes, like a local world.
    let is_empty = record.present().all(|body| body.traits.kind == BodyKind::Fixed);
    let halo_m = if is_empty && lag_ticks == 0 { halo_m } else { Some(host.partition().halo_m() + ahead_m) };
    let environment = EnvironmentProperties {
        world: record.fingerprint(),
        step: step.record(),
        tree,
        balance,
        fidelity,
        viewpoints,
        halo_m,
        avatar_speed_limit: config.avatar_speed_limit,
        protocol,
        thresholds: config.groups.thresholds,
        pace: config.pace,
        state_every: config.state_every,
        last_tick: config.last_tick,
        relays_above: config.relays_above,
    };
    Ok((environment, record))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Params;
    use crate::sim::sim_world;

    fn of_scene(scene: &Scene) -> Beginning {
        Beginning::of(Origin::Scene(scene, &WorldConfig::for_scene(scene))).unwrap()
    }

    #[test]
    fn a_level_that_was_saved_uncut_follows_its_nodes_and_one_that_was_cut_stays() {
        let saved = |partitioning| {
            let world = LocalWorld::new(WorldConfig { partitioning, ..WorldConfig::default() }).unwrap();
            let mut file = Vec::new();
            world.save(&mut file).unwrap();
            let level = LocalWorld::restore(&file[..], 1).unwrap();
            Beginning::of(Origin::World(&level)).unwrap().balance
        };
        assert_eq!(saved(Partitioning::Auto), Some(Balance::by_nodes()));
        assert_eq!(saved(Partitioning::Regions(2)), None);
    }

    #[test]
    fn towns_that_are_far_apart_have_a_region_each_also_where_they_are_served() {
        let town = |x: f64| {
            format!("[[body]]\nposition = [{x}, 1, 0]\n[[body.collider]]\nshape = \"sphere\"\nradius = 0.5\n")
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("far.toml");
        std::fs::write(&path, town(-30_000.0) + &town(30_000.0)).unwrap();
        let far = Scene::load(&path, &Params::new()).unwrap();
        let local = LocalWorld::from_scene(&far, WorldConfig::for_scene(&far)).unwrap();
        for begun in [of_scene(&far), Beginning::of(Origin::World(&local)).unwrap()] {
            assert_eq!((begun.tree.leaf_count(), begun.balance.unwrap().least_regions), (2, 2));
        }
        let near = Scene::named("tower", &Params::new()).unwrap();
        assert_eq!(of_scene(&near).balance, Some(Balance::by_nodes()));
    }

    #[test]
    fn a_scene_that_says_how_it_is_balanced_is_so_where_it_is_served() {
        let mut scene = Scene::named("tower", &Params::new()).unwrap();
        scene.regions = Some(2);
        assert_eq!(of_scene(&scene).balance, None);
        scene.balance = Some(Balance { most_regions: 8, ..Balance::default() });
        assert_eq!(of_scene(&scene).balance, scene.balance);
    }

    #[test]
    fn shapes_that_cannot_be_sent_are_refused_before_a_server_runs() {
        let field = |size: u32| {
            let heights = vec![0.0; (size * size) as usize];
            ShapeRecord::HeightField(heights, size, size, [100.0, 1.0, 100.0], 0, Vec::new())
        };
        let begin = |shapes: Vec<ShapeRecord>| {
            let beginning = Beginning {
                tree: sim_world(2).tree,
                balance: None,
                halo_m: None,
                step: StepSettings::default(),
                fidelity: Fidelity::Off,
                viewpoints: Vec::new(),
                shapes,
                bodies: Vec::new(),
                joints: Vec::new(),
            };
            world_of(beginning, &ServeConfig::new("unused")).map(drop)
        };
        begin(vec![field(600)]).unwrap();
        let refused = begin(vec![field(2_049)]).unwrap_err().to_string();
        assert!(refused.contains("15.5 MiB") && refused.contains("several colliders"), "{refused}");
        // It is short when sent, but counted by the memory it takes where it is read.
        let voxels = (0..1_500_000).map(|i| [i / 15_000, i / 150 % 100, i % 150]).collect();
        let refused = begin(vec![ShapeRecord::Voxels([1.0; 3], voxels)]).unwrap_err().to_string();
        assert!(refused.contains("15.5 MiB"), "{refused}");
    }
}
