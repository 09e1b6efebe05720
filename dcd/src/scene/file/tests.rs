//! Tests scene files: those that are shipped, and wrong ones.

use rapier3d::prelude::*;

use super::*;
use crate::fidelity::Fidelity;
use crate::physics::Coupling;
use crate::scene::SceneBody;
use crate::space::{Axis, Bounds, Viewpoint};

const FLOOR: &str = "[[body]]\nkind = \"fixed\"\n[[body.collider]]\nshape = \"box\"\nhalf_size = [9, 1, 9]\n";

fn read(text: &str) -> Result<Scene, SceneError> {
    parse(&Source { path: Path::new("test.toml"), text }, &Params::new())
}

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    Scene::load(path, &Params::new()).unwrap_or_else(|error| panic!("{error}"))
}

/// Asserts that a wrong file is refused with an error that names the line and each of the given parts.
#[track_caller]
fn refused(text: &str, line: usize, parts: &[&str]) {
    let error = read(text).expect_err("the file is wrong").to_string();
    assert!(error.starts_with(&format!("test.toml:{line}: ")), "{error}");
    for part in parts {
        assert!(error.contains(part), "no `{part}` in: {error}");
    }
}

#[test]
fn all_shipped_files_run_for_a_second() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let scene = Scene::open(path.to_str().unwrap(), &Params::new()).unwrap_or_else(|e| panic!("{e}"));
        let mut world = scene.bare_world();
        for _ in 0..(1.0 / scene.dt_s) as usize {
            world.step();
        }
        assert!(world.quarantine().is_empty(), "{}", scene.name);
        for (_, body) in world.rigid_bodies().filter(|(_, body)| body.is_dynamic()) {
            assert!(body.translation().y > -0.1, "{}: a body fell to {}", scene.name, body.translation());
            assert!(body.linvel().length() < 20.0, "{}: a body is shot away", scene.name);
        }
        count += 1;
    }
    assert_eq!(count, 4);
}

#[test]
fn a_file_says_how_much_is_computed_in_full() {
    let of = |world: &str| {
        let scene = read(&format!("[world]\n{world}\n{FLOOR}")).unwrap();
        (crate::runtime::WorldConfig::for_scene(&scene).fidelity, scene.viewpoints)
    };
    assert_eq!(of(""), (Fidelity::Off, vec![]));
    let view = Viewpoint { at: [0.0, 2.0, -1.0], radius_m: 30.0 };
    let asked = "fidelity = \"auto\"\nviewpoints = [{ at = [0, 2, -1], radius = 30 }]";
    assert_eq!(of(asked), (Fidelity::AUTO, vec![view]));
    assert_eq!(of("fidelity = \"budget=8\"").0, Fidelity::Budget { tick_ms: 8.0 });
    let wrong = |line, at, parts: &[&str]| refused(&format!("[world]\n{line}\n{FLOOR}"), at, parts);
    wrong("fidelity = \"some\"", 1, &["`some` is none of off, auto", "write off, auto"]);
    wrong("fidelity = \"budget=0\"", 1, &["`0` must be finite and above 0"]);
    wrong("viewpoints = [{ at = [0, 0, 0], radius = -1 }]", 2, &["-1 is not"]);
}

#[test]
fn a_file_chooses_how_regions_agree() {
    let step = |world: &str| {
        let scene = read(&format!("[world]\n{world}\n{FLOOR}")).unwrap();
        crate::runtime::WorldConfig::for_scene(&scene).step
    };
    assert_eq!((step("").coupling, step("").exchanges), (Coupling::Auto, 4));
    let overlap = step("coupling = \"overlap\"\ndepth = 3\nisland_limit = 0\ntolerance = 0.5");
    assert_eq!((overlap.coupling, overlap.exchanges, overlap.depth), (Coupling::Overlap, 2, 3));
    assert_eq!((overlap.island_limit, overlap.tolerance_m_s), (0, 0.5));
    assert_eq!((step("").speed_limit_m_s(), step("speed_limit = 900").speed_limit_m_s()), (400.0, 900.0));
    let draft = step("preset = \"draft\"\nexchanges = 3");
    assert_eq!((draft.coupling, draft.exchanges, draft.island_limit), (Coupling::Auto, 3, 256));
    let wrong = |line, parts: &[&str]| refused(&format!("[world]\n{line}\n{FLOOR}"), 2, parts);
    wrong("coupling = \"magic\"", &["unknown variant `magic`", "`proxy`", "`auto`", "correct this line"]);
    wrong("preset = \"fine\"", &["unknown variant `fine`", "`draft`, `game`, `precise`"]);
    wrong("tolerance = 0", &["0 is not a finite number above 0"]);
    wrong("speed_limit = -1", &["-1 is not a finite number above 0"]);
    let out_of_range = |line, parts: &[&str]| refused(&format!("[world]\n{line}\n{FLOOR}"), 1, parts);
    out_of_range("exchanges = 65", &["[world] exchanges = 65 is out of range", "from 1 to 64"]);
    out_of_range("depth = 0", &["[world] depth = 0 is out of range", "from 1 to 16"]);
    out_of_range("island_limit = 65535", &["from 0 to 65534"]);
    out_of_range("coupling = \"auto\"\npreset = \"game\"", &["both `coupling` and `preset`", "write one"]);
}

#[test]
fn the_playground_gives_both_halves_work_and_an_avatar_its_start() {
    let scene = shipped("playground.toml");
    assert_eq!((scene.regions, scene.cuts.as_slice()), (Some(2), [(Axis::X, 0.0)].as_slice()));
    assert_eq!((scene.bounds.longest_axis(), scene.bounds.centre()[0]), (Axis::X, 0.0));
    let movable: Vec<_> =
        scene.bodies.iter().filter(|body| body.body.body_type == RigidBodyType::Dynamic).collect();
    let left = movable.iter().filter(|body| body.pose.translation[0] < 0.0).count();
    assert!(movable.len() > 150 && left.abs_diff(movable.len() - left) < 30, "{left} of {}", movable.len());
    assert_eq!(scene.avatar.unwrap().drive_m_s, [5.0, 0.0, 0.0]);
}

#[test]
fn every_domino_falls() {
    let scene = shipped("dominoes.toml");
    let mut world = scene.bare_world();
    for _ in 0..1_200 {
        world.step();
    }
    // Body 0 is the floor, 1 the ball: those of [[body]] come before those of [[grid]].
    let dominoes = world.rigid_bodies().skip(2).map(|(_, body)| body);
    let upright = dominoes.filter(|body| (*body.rotation() * Vector::Y).y > 0.9).count();
    assert_eq!(upright, 0);
}

#[test]
fn the_bridge_hangs_and_carries_its_crates() {
    let scene = shipped("bridge.toml");
    let mut world = scene.bare_world();
    for _ in 0..300 {
        world.step();
    }
    for (_, body) in world.rigid_bodies().filter(|(_, body)| body.is_dynamic()) {
        assert!(body.translation().y > 1.0, "{}", body.translation());
    }
}

#[test]
fn the_motor_turns_the_paddle() {
    let scene = shipped("compound.toml");
    let mut world = scene.bare_world();
    for _ in 0..120 {
        world.step();
    }
    let spins: Vec<_> =
        world.rigid_bodies().map(|(_, body)| body.angvel().y).filter(|spin| *spin > 1.0).collect();
    assert!(!spins.is_empty(), "nothing turns");
}

#[test]
fn every_property_of_a_body_and_a_collider_arrives() {
    let scene = read(
        r#"
        [world]
        name = "all"
        gravity = [0, -1.62, 0]
        dt = 0.01
        solver_iterations = 6
        [[body]]
        position = [1e7, 2, 3]
        euler_deg = [0, 0, 90]
        velocity = [1, 2, 3]
        spin = [4, 5, 6]
        linear_damping = 0.1
        angular_damping = 0.2
        gravity_scale = 0.5
        lock_position = ["y"]
        lock_rotation = ["x", "z"]
        dominance = -3
        ccd = true
        soft_ccd = 0.3
        fast_rotation = true
        gyroscopic = false
        can_sleep = false
        extra_mass = 2.5
        extra_solver_iterations = 4
        extra_pgs_iterations = 2
        user_data = 99
        [[body.collider]]
        shape = "capsule"
        half_height = 1
        radius = 0.5
        position = [0, 1, 0]
        density = 3
        friction = 0.7
        friction_rule = "geometric-mean"
        restitution = 0.4
        restitution_rule = "max"
        sensor = true
        groups = { in = [1, 32], with = [2], any = true }
        solver_groups = { in = [3] }
        events = ["touch", "force"]
        force_threshold = 12
        skin = 0.01
        user_data = 7
        "#,
    )
    .unwrap();
    assert_eq!((scene.gravity[1], scene.dt_s, scene.solver_iterations), (-1.62, 0.01, 6));
    let SceneBody { pose, body, colliders } = &scene.bodies[0];
    assert_eq!(pose.translation, [1e7, 2.0, 3.0]);
    let up = Rotation::from_array(pose.rotation) * Vector::X;
    assert!(up.distance(Vector::Y) < 1e-6, "{up}");
    assert_eq!((body.linvel, body.angvel), (Vector::new(1.0, 2.0, 3.0), Vector::new(4.0, 5.0, 6.0)));
    assert_eq!((body.linear_damping, body.angular_damping, body.gravity_scale), (0.1, 0.2, 0.5));
    assert_eq!((body.dominance_group, body.ccd_enabled, body.soft_ccd_prediction), (-3, true, 0.3));
    assert_eq!(
        (body.allow_fast_rotation, body.gyroscopic_forces_enabled, body.can_sleep),
        (true, false, false)
    );
    assert_eq!(
        (body.additional_solver_iterations, body.additional_pgs_iterations, body.user_data),
        (4, 2, 99)
    );
    let locks =
        LockedAxes::TRANSLATION_LOCKED_Y | LockedAxes::ROTATION_LOCKED_X | LockedAxes::ROTATION_LOCKED_Z;
    assert_eq!(body.build().locked_axes(), locks);
    let collider = &colliders[0];
    assert_eq!(collider.position.translation, Vector::Y);
    assert_eq!(collider.mass_properties, ColliderMassProps::Density(3.0));
    assert_eq!((collider.friction, collider.restitution, collider.is_sensor), (0.7, 0.4, true));
    assert_eq!(collider.friction_combine_rule, CoefficientCombineRule::GeometricMean);
    assert_eq!(collider.restitution_combine_rule, CoefficientCombineRule::Max);
    let groups =
        InteractionGroups::new(Group::GROUP_1 | Group::GROUP_32, Group::GROUP_2, InteractionTestMode::Or);
    assert_eq!(collider.collision_groups, groups);
    let solver = InteractionGroups::new(Group::GROUP_3, Group::ALL, InteractionTestMode::And);
    assert_eq!(collider.solver_groups, solver);
    assert_eq!(collider.active_events, ActiveEvents::all());
    assert_eq!((collider.contact_force_event_threshold, collider.contact_skin), (12.0, 0.01));
    assert_eq!(collider.user_data, 7);
    let bounds = Bounds::new([1e7 - 3.5, 0.5, 1.5], [1e7 + 1.5, 3.5, 4.5]);
    assert_eq!(scene.bounds, bounds);
}

#[test]
fn a_joint_holds_the_pose_its_bodies_start_in() {
    let scene = read(
        r#"
        [[body]]
        name = "a"
        kind = "fixed"
        position = [10, 5, 0]
        euler_deg = [0, 0, 90]
        [[body]]
        name = "b"
        position = [12, 6, 1]
        euler_deg = [40, 0, 0]
        extra_mass = 1
        [[joint]]
        kind = "fixed"
        a = "a"
        b = 1
        anchor_a = [1, 0, 0]
        "#,
    )
    .unwrap();
    let joint = scene.joints[0].joint;
    let [a, b] = [0, 1].map(|i| crate::scene::model::bare_pose(&scene.bodies[i].pose));
    let (frame_a, frame_b) = (a * joint.local_frame1, b * joint.local_frame2);
    assert!(frame_a.translation.distance(frame_b.translation) < 1e-5);
    assert!(frame_a.rotation.angle_between(frame_b.rotation) < 1e-3);
    assert!(frame_a.translation.distance(Vector::new(10.0, 6.0, 0.0)) < 1e-5);
}

#[test]
fn a_file_may_start_from_the_library_and_parameters_change_it() {
    let text = format!("[library]\nscene = \"tower\"\nparams = {{ n = 4 }}\n[world]\nregions = 2\n{FLOOR}");
    let scene = read(&text).unwrap();
    assert_eq!((scene.bodies.len(), scene.regions, scene.name.as_str()), (6, Some(2), "tower"));
    let source = Source { path: Path::new("test.toml"), text: &text };
    assert_eq!(parse(&source, &Params::new().with("n", 9)).unwrap().bodies.len(), 11);
    let error = parse(&source, &Params::new().with("m", 9)).unwrap_err().to_string();
    assert!(error.starts_with("test.toml:1: scene `tower` has no parameter `m`"), "{error}");
}

#[test]
fn a_file_may_cut_a_library_scene_otherwise() {
    let cut = |line: &str| {
        let text = format!("[library]\nscene = \"town\"\nparams = {{ n = 600 }}\n[world]\n{line}\n");
        let scene = read(&text).unwrap();
        (scene.regions, scene.cuts.len())
    };
    assert_eq!(cut(""), (None, 8));
    assert_eq!(cut("regions = 4"), (Some(4), 0), "cuts would win");
    assert_eq!(cut("cuts = []"), (None, 0));
    assert_eq!(cut("regions = 4\ncuts = [{ axis = \"x\", at = 0 }]"), (Some(4), 1));
    let far = "[library]\nscene = \"tower\"\n[world]\nbounds = { min = [-2e5, -1, -1], max = [2e5, 1, 1] }\n";
    let far = read(&format!("{far}cuts = [{{ axis = \"x\", at = 100000.3 }}]\n")).unwrap();
    assert_eq!(far.cuts, [(Axis::X, 100_000.3)], "as --cut says it");
    let middle = "bounds = { min = [-70, 0, -50], max = [70, 30, 50] }";
    assert_eq!(cut(middle), (None, 4), "the other planes are beside it");
}

#[test]
fn a_file_may_look_at_a_library_scene_from_nowhere() {
    let viewpoints = |line: &str| {
        let text = format!("[library]\nscene = \"town\"\nparams = {{ n = 600 }}\n[world]\n{line}\n");
        read(&text).unwrap().viewpoints.len()
    };
    assert_eq!((viewpoints(""), viewpoints("viewpoints = []")), (1, 0));
}

#[test]
fn parameters_of_a_file_without_a_library_scene_are_refused() {
    let source = Source { path: Path::new("test.toml"), text: FLOOR };
    let error = parse(&source, &Params::new().with("n", 9)).unwrap_err().to_string();
    assert!(error.contains("takes no parameters, but `n` was given"), "{error}");
}

#[test]
fn a_grid_with_equal_seeds_is_equal_and_its_copies_have_names() {
    let text = format!(
        "{FLOOR}[[grid]]\ncount = [2, 3, 1]\nspacing = [2, 1, 0]\njitter = 0.1\nseed = 5\n[grid.body]\nname = \"g\"\n\
         extra_mass = 1\n[[joint]]\nkind = \"rope\"\nlength = 1\na = \"g[0]\"\nb = \"g[5]\"\n"
    );
    let places = || read(&text).unwrap().bodies.iter().map(|body| body.pose.translation).collect::<Vec<_>>();
    assert_eq!(places(), places());
    let last = places()[6];
    assert!((last[0] - 2.0).abs() < 0.1 && (last[1] - 2.0).abs() < 0.1, "{last:?}");
}

#[test]
fn unknown_keys_are_named_with_the_known_ones_and_their_line() {
    refused("[world]\ngravitas = 1\n", 2, &["unknown field `gravitas`", "`gravity`", "README"]);
    refused(&format!("{FLOOR}frictoin = 1\n"), 6, &["unknown field `frictoin`", "`friction`"]);
    refused("[[body]]\nkind = \"static\"\n", 2, &["unknown variant `static`", "`fixed`"]);
    refused("[[bodies]]\n", 1, &["unknown field `bodies`", "`body`"]);
}

#[test]
fn numbers_that_no_world_can_use_are_refused_at_their_line() {
    for position in ["[0, nan, 0]", "[1.1e9, 0, 0]"] {
        refused(&format!("[[body]]\nposition = {position}\n"), 2, &["not a number of metres within 1e9"]);
    }
    refused("[world]\ndt = 0\n", 2, &["`dt`: 0 is not a finite number above 0"]);
    refused("[[body]]\nvelocity = [1e39, 0, 0]\n", 2, &["`velocity`: ", "not a finite number"]);
    refused("[[body]]\nvelocity = [\n1,\n1e39, 0]\n", 2, &["`velocity`: ", "not a finite number"]);
    refused("[world]\nbounds = { min = [0, 0, 0], max = \"x\" }\n", 2, &["`max`: invalid type"]);
    refused(&format!("{FLOOR}restitution = 50\n"), 6, &["50 is not a number from 0 to 1"]);
    assert!(read(&format!("{FLOOR}restitution = 1\nfriction = 50\n")).is_ok());
    refused("[[body]]\nrotation = [0, 0, 0, 2]\n", 2, &["not a unit quaternion", "euler_deg"]);
    let sphere = "[[body]]\n[[body.collider]]\nshape = \"sphere\"\nradius = -1\n";
    refused(sphere, 4, &["-1 is not a finite number above 0"]);
}

#[test]
fn what_does_not_fit_together_is_refused_at_its_table() {
    refused("\n[world]\nregions = 257\n[[body]]\nextra_mass = 1\n", 2, &["regions = 257", "from 1 to 256"]);
    refused("[world]\nbounds = { min = [0, 0, 0], max = [1, 0, 1] }\n", 1, &["hold nothing"]);
    refused("[world]\nname = \"empty\"\n", 1, &["no finite body"]);
    refused("[[body]]\nname = \"x\"\n", 1, &["no mass", "extra_mass"]);
    let hollow = &["no mass", "a halfspace, an open mesh", "give its [[body.collider]] a mass", "\"fixed\""];
    refused("[[body]]\n[[body.collider]]\nshape = \"halfspace\"\nnormal = [0, 1, 0]\n", 1, hollow);
    let open = "[[body]]\n[[body.collider]]\nshape = \"mesh\"\npoints = [[0,0,0],[1,0,0],[0,0,1]]\ntriangles = [[0,1,2]]\n";
    refused(open, 1, hollow);
    assert_eq!(read(&format!("{open}mass = 1\n")).unwrap().bodies.len(), 1);
    let cube = "[[body]]\n[[body.collider]]\nshape = \"box\"\n";
    refused(&format!("{cube}half_size = [1, 1, 1]\nenabled = false\n"), 1, &["no mass", "enabled"]);
    let heavy = format!("{cube}half_size = [1, 1, 1]\nmass = 3e38\n");
    let twice = format!("{heavy}{}", &heavy["[[body]]\n".len()..]);
    refused(&twice, 1, &["beyond single precision", "lighter"]);
    refused(
        &format!("{cube}half_size = [2, 2, 2]\ndensity = 1e38\n"),
        1,
        &["beyond single precision", "lighter"],
    );
    refused("[[body]]\n[[body.collider]]\nshape = \"sphere\"\nradius = 1e30\n", 1, &["beyond", "smaller"]);
    refused(&format!("{cube}half_size = [2, 2, 2]\ndensity = 0\n"), 1, &["no mass"]);
    let box_with_radius = format!("\n{FLOOR}radius = 1\n");
    refused(&box_with_radius, 4, &["shape `box` has no `radius`", "half_size, border"]);
    refused("[[body]]\n[[body.collider]]\nshape = \"cone\"\nradius = 1\n", 2, &["lacks `half_height`"]);
    refused(&format!("{FLOOR}density = 1\nmass = 1\n"), 3, &["both `density` and `mass`"]);
    for kind in ["fixed", "kinematic-position"] {
        let moves = format!("[[body]]\nkind = \"{kind}\"\nspin = [0, 1, 0]\n");
        refused(&moves, 1, &[kind, "`spin`", "would not move", "kinematic-velocity"]);
    }
    let hull =
        "[[body]]\n[[body.collider]]\nshape = \"hull\"\npoints = [[0,0,0],[1,1,0],[1,1,1],[0,0,1],[2,2,1]]\n";
    refused(hull, 2, &["enclose no volume"]);
    let mesh = "[[body]]\n[[body.collider]]\nshape = \"mesh\"\npoints = [[0,0,0],[1,0,0],[0,0,1]]\ntriangles = [[0,1,3]]\n";
    refused(mesh, 2, &["names point 3, but there are 3"]);
    let two = format!("{FLOOR}[[body]]\nname = \"x\"\nextra_mass = 1\n");
    refused(
        &format!("{two}[[joint]]\nkind = \"fixed\"\na = \"y\"\nb = 0\n"),
        9,
        &["body `y`, which does not exist"],
    );
    refused(&format!("{two}[[joint]]\nkind = \"fixed\"\na = 2\nb = 0\n"), 9, &["body 2, but there are 2"]);
    refused(&format!("{two}[[joint]]\nkind = \"fixed\"\na = 1\nb = \"x\"\n"), 9, &["to itself"]);
    refused(&format!("{two}[[joint]]\nkind = \"rope\"\na = 1\nb = 0\n"), 9, &["lacks `length`"]);
    refused(
        &format!("{two}[[joint]]\nkind = \"fixed\"\na = 1.5\nb = 0\n"),
        11,
        &["by a string or by its index"],
    );
    refused(&format!("{two}[[body]]\nname = \"x\"\nextra_mass = 1\n"), 9, &["two bodies are named `x`"]);
}

#[test]
fn a_mesh_bears_one_side_or_both_as_the_file_says() {
    let mesh = "[[body]]\nkind = \"fixed\"\n[[body.collider]]\nshape = \"mesh\"\npoints = [[0,0,0],[1,0,0],[0,0,1]]\ntriangles = [[0,2,1]]\n";
    for (line, is_one_sided) in [("", true), ("one_sided = true\n", true), ("one_sided = false\n", false)] {
        let scene = read(&format!("{mesh}{line}")).unwrap();
        let flags = scene.bodies[0].colliders[0].shape.as_trimesh().unwrap().flags();
        assert_eq!(flags.contains(TriMeshFlags::FIX_INTERNAL_EDGES), is_one_sided, "{line}");
    }
    refused(&format!("{FLOOR}one_sided = true\n"), 3, &["shape `box` has no `one_sided`"]);
}

#[test]
fn a_file_that_is_not_there_is_an_error_with_its_path() {
    let error = Scene::open("no/such/file.toml", &Params::new()).unwrap_err().to_string();
    assert!(error.contains("cannot read scene file no/such/file.toml"), "{error}");
}

#[test]
fn the_readme_names_every_key_and_every_library_scene() {
    let readme = include_str!("../../../scenes/README.md");
    let documented = |word: &str| {
        assert!(readme.contains(word), "`{word}` is missing in dcd/scenes/README.md");
    };
    for table in [
        "x = 1",
        "[world]\nx = 1",
        "[avatar]\nx = 1",
        "[library]\nx = 1",
        "[[body]]\nx = 1",
        "[[body]]\n[[body.collider]]\nx = 1",
        "[[body]]\n[[body.collider]]\ngroups = { x = 1 }",
        "[[grid]]\nx = 1",
        "[[joint]]\nx = 1",
        "[[joint]]\nmotor = { x = 1 }",
        "[[joint]]\nsoftness = { x = 1 }",
        "[[body]]\nkind = \"x\"",
        "[[body]]\n[[body.collider]]\nshape = \"x\"",
        "[[body]]\n[[body.collider]]\nfriction_rule = \"x\"",
        "[[body]]\n[[body.collider]]\nevents = [\"x\"]",
        "[[joint]]\nkind = \"x\"",
        "[[joint]]\nmotor = { model = \"x\" }",
    ] {
        // The reader's own message lists what it knows: `unknown field `x`, expected one of `a`, `b``.
        let error = read(table).unwrap_err().to_string();
        let known: Vec<_> =
            error.split("expected").nth(1).expect(&error).split('`').skip(1).step_by(2).collect();
        assert!(!known.is_empty(), "{error}");
        known.into_iter().for_each(documented);
    }
    crate::scene::library().iter().for_each(|info| documented(info.name));
}

#[test]
fn the_example_of_the_readme_is_a_scene() {
    let readme = include_str!("../../../scenes/README.md");
    let example = readme.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    assert_eq!(read(example).unwrap().bodies.len(), 2);
}
