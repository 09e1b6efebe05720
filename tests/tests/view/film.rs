//! Reads the glTF files of `dcd run` and `dcd client` with another crate, and compares them with where the
//! bodies are.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use dcd::prelude::*;
use gltf::animation::util::ReadOutputs;

use crate::process::Process;

/// A node of a file: its place in the world, its rotation, the colours of what is drawn of it, and its
/// region.
struct Node {
    at: [f64; 3],
    turn: [f32; 4],
    colours: BTreeSet<[u32; 4]>,
    region: Option<u64>,
}

fn open(path: &Path) -> gltf::Gltf {
    // This validates the file: indices, lists without gaps, required parts.
    gltf::Gltf::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn blob(file: &gltf::Gltf) -> &[u8] {
    file.blob.as_deref().expect("its buffer is in the file")
}

fn origin(file: &gltf::Gltf) -> [f32; 3] {
    let scene = file.default_scene().expect("a scene");
    let mut roots = scene.nodes();
    let root = roots.next().expect("a root");
    assert_eq!((root.name(), roots.count()), (Some("world"), 0));
    root.transform().decomposed().0
}

/// Returns the bodies of a file, by their names.
fn bodies(file: &gltf::Gltf) -> BTreeMap<String, Node> {
    let origin = origin(file);
    let root = file.default_scene().unwrap().nodes().next().unwrap();
    let body = |node: gltf::Node<'_>| {
        let (at, turn, _) = node.transform().decomposed();
        let parts = node.children().filter_map(|part| part.mesh());
        let colours = parts.flat_map(|mesh| {
            let materials = mesh.primitives().map(|part| part.material().pbr_metallic_roughness());
            materials.map(|material| material.base_color_factor().map(f32::to_bits)).collect::<Vec<_>>()
        });
        let at = std::array::from_fn(|i| f64::from(origin[i]) + f64::from(at[i]));
        let extras: serde_json::Value =
            serde_json::from_str(node.extras().as_ref().expect("extras").get()).unwrap();
        let region = extras["region"].as_u64();
        (node.name().expect("a name").to_owned(), Node { at, turn, colours: colours.collect(), region })
    };
    root.children().map(body).collect()
}

fn run(args: &[&str]) {
    let mut process = Process::start(args);
    process.line("{\"scene\"");
}

#[test]
fn a_moment_has_every_body_where_it_is_in_the_colour_of_its_owner() {
    let folder = tempfile::tempdir().unwrap();
    let (film, list) = (folder.path().join("end.glb"), folder.path().join("end.csv"));
    let scene = ["run", "gas", "--set", "n=100", "--regions", "4", "--seconds", "1", "--json"];
    let files = ["--gltf", film.to_str().unwrap(), "--out", list.to_str().unwrap()];
    run(&[&scene[..], &files].concat());
    let file = open(&film);
    assert_eq!(file.animations().count(), 0);
    let bodies = bodies(&file);
    let mut colour_of = BTreeMap::new();
    let list = std::fs::read_to_string(list).unwrap();
    let mut movable = 0;
    for row in list.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let node = &bodies[&BodyId::from_bits(cells[0].parse().unwrap()).to_string()];
        for i in 0..3 {
            let exact: f64 = cells[1 + i].parse().unwrap();
            assert!((node.at[i] - exact).abs() < 1e-5, "{row}");
        }
        assert!((0..4).all(|i| node.turn[i] == cells[4 + i].parse::<f32>().unwrap()), "{row}");
        let region: u64 = cells[14].parse().unwrap();
        assert_eq!(node.region, Some(region));
        let sleeps_or_not = colour_of.entry(region).or_insert_with(BTreeSet::new);
        sleeps_or_not.extend(node.colours.iter().copied());
        assert!(node.colours.len() == 1 && sleeps_or_not.len() <= 2, "{row}");
        movable += 1;
    }
    assert_eq!((movable, colour_of.len()), (100, 4));
    let colours: BTreeSet<_> = colour_of.values().map(|colours| colours.iter().next()).collect();
    assert_eq!(colours.len(), 4, "each region has its own");
    assert!(bodies.len() > 100, "and what is fixed");
}

#[test]
fn a_stretch_is_an_animation_that_goes_as_the_bodies_did() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fall.glb");
    let stretch = ["--gltf-seconds", "0.5..1.5", "--gltf-rate", "20", "--gltf", path.to_str().unwrap()];
    let scene =
        ["run", "gas", "--set", "n=20", "--regions", "1", "--threads", "1", "--seconds", "2", "--json"];
    run(&[&scene[..], &stretch].concat());
    let file = open(&path);
    let origin = origin(&file);
    let animation = file.animations().next().expect("an animation");
    // The places of each body over time, by the file.
    let mut filmed = BTreeMap::new();
    for channel in animation.channels() {
        let reader = channel.reader(|_| Some(blob(&file)));
        let times: Vec<f32> = reader.read_inputs().unwrap().collect();
        assert!(times.windows(2).all(|two| two[0] < two[1]) && times[0] == 0.0);
        if let ReadOutputs::Translations(places) = reader.read_outputs().unwrap() {
            let name = channel.target().node().name().unwrap().to_owned();
            filmed.insert(name, times.into_iter().zip(places).collect::<Vec<_>>());
        }
    }
    let scene = Scene::open("gas", &Params::new().with("n", 20)).unwrap();
    let config = WorldConfig { threads: 1, ..WorldConfig::for_scene(&scene) };
    let mut world = World::from_scene(&scene, config).unwrap();
    let mut compared = 0;
    for tick in 1..=90 {
        world.step().unwrap();
        let seconds = f64::from(tick) / 60.0 - 0.5;
        for body in world.movable_bodies() {
            let Some(keys) = filmed.get(&body.id.to_string()) else { continue };
            let Some((_, at)) = keys.iter().find(|(time, _)| (f64::from(*time) - seconds).abs() < 1e-3)
            else {
                continue;
            };
            for i in 0..3 {
                let off = f64::from(origin[i]) + f64::from(at[i]) - body.pose.translation[i];
                assert!(off.abs() < 1e-5, "{} at tick {tick}: {off}", body.id);
            }
            compared += 1;
        }
    }
    assert!(compared >= 400, "{compared} poses of {} bodies", filmed.len());
    let first = bodies(&file);
    for (name, keys) in &filmed {
        let begin: [f64; 3] = std::array::from_fn(|i| f64::from(origin[i]) + f64::from(keys[0].1[i]));
        assert_eq!(first[name].at, begin, "a reader without animations shows the beginning");
    }
}

#[test]
fn every_kind_of_shape_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shapes.glb");
    let mut world = World::new(WorldConfig::default()).unwrap();
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector::from_array);
    let shapes = [
        ColliderBuilder::ball(0.5),
        ColliderBuilder::cuboid(0.5, 1.0, 1.5),
        ColliderBuilder::capsule_y(1.0, 0.25),
        ColliderBuilder::cylinder(1.0, 0.25),
        ColliderBuilder::cone(1.0, 0.25).sensor(true),
        ColliderBuilder::convex_hull(&corners).unwrap(),
        ColliderBuilder::polyline(corners.to_vec(), None),
        ColliderBuilder::triangle(corners[0], corners[1], corners[2]),
    ];
    for (place, shape) in shapes.into_iter().enumerate() {
        let at = Vector::new(1e6 + 4.0 * place as f32, 0.0, 0.0);
        world.insert(RigidBodyBuilder::kinematic_position_based().translation(at), shape).unwrap();
    }
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::new(SharedShape::halfspace(Vector::Y))).unwrap();
    world.save_gltf(&path).unwrap();
    let file = open(&path);
    let height = |name: &str| {
        let root = file.default_scene().unwrap().nodes().next().unwrap();
        let body = root.children().find(|node| node.name() == Some(name)).unwrap();
        let part = body.children().next().expect("a shape");
        let scale = part.transform().decomposed().2[1];
        let primitive = part.mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(blob(&file)));
        let corners: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert!(indices.iter().all(|&at| (at as usize) < corners.len()) && !indices.is_empty());
        let box_ = primitive.bounding_box();
        for i in 0..3 {
            let lowest = corners.iter().map(|corner| corner[i]).fold(f32::INFINITY, f32::min);
            assert_eq!(box_.min[i], lowest);
        }
        (scale * (box_.max[1] - box_.min[1]), primitive.mode())
    };
    use gltf::mesh::Mode;
    let expected = [1.0, 2.0, 2.5, 2.0, 2.0, 1.0, 1.0, 1.0];
    for (place, exact) in expected.into_iter().enumerate() {
        let (height, mode) = height(&format!("b{place}"));
        assert!((height - exact).abs() < 1e-5, "b{place}: {height}");
        assert_eq!(mode, if place == 6 { Mode::Lines } else { Mode::Triangles });
    }
    // A thousand kilometres away f32 is exact, since all is relative to the middle.
    let far = bodies(&file)["b1"].at[0];
    assert_eq!(far, world.movable_bodies().nth(1).unwrap().pose.translation[0]);
    let materials: Vec<_> = file.materials().map(|material| material.alpha_mode()).collect();
    assert!(materials.contains(&gltf::material::AlphaMode::Blend), "sensors are faint");
}

#[test]
fn a_client_films_what_it_is_told_of() {
    let data = tempfile::tempdir().unwrap();
    let film = data.path().join("client.glb");
    let folder = data.path().join("server");
    let folder = folder.to_str().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../dcd/scenes/playground.toml");
    let mut server = Process::start(&["serve", scene, "--listen", "127.0.0.1:0", "--data", folder]);
    let address = server.line("listening ");
    let token = |role: &str| {
        format!("dcd1-{}", Process::start(&["token", "--data", folder, "--role", role]).line("dcd1-"))
    };
    let _node = Process::start(&["node", "--server", &address, "--token", &token("node")]);
    let stay = ["--seconds", "3", "--gltf", film.to_str().unwrap(), "--gltf-seconds", "1..2", "--json"];
    let mut client =
        Process::start(&[&["client", "--server", &address, "--token", &token("client")], &stay[..]].concat());
    client.line("{\"client\"");
    let file = open(&film);
    let bodies = bodies(&file);
    assert!(bodies.keys().any(|name| name.starts_with('c')), "its avatar: {:?}", bodies.keys());
    assert!(bodies.len() > 6 && file.animations().count() == 1);
}

#[test]
fn a_film_takes_a_world_of_regions_a_folder_that_is_there_and_a_stretch_that_has_a_length() {
    let nowhere = ["run", "tower", "--gltf", "/nowhere/at/all.glb"];
    assert!(Process::start(&nowhere).line("error: ").contains("check the path"));
    let bare = ["run", "tower", "--regions", "0", "--gltf", "/dev/null"];
    assert!(Process::start(&bare).line("error: ").contains("--gltf takes a world of regions"));
    let backwards = ["run", "tower", "--gltf", "/dev/null", "--gltf-seconds", "3..1"];
    assert!(Process::start(&backwards).line("error: ").contains("the lower one first"));
    let late = ["run", "tower", "--seconds", "0.1", "--gltf", "/dev/null", "--gltf-seconds", "5..9"];
    assert!(
        Process::start(&late)
            .line("error: ")
            .contains("--gltf-seconds 5..9 begins when the run of 0.1 s is over")
    );
}
