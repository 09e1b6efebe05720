//! Draws a world of any role by the program's own renderer, or into a glTF file.

use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::Path;

use super::World;
use super::error::Error;
use crate::drawing::{
    ContactSeen, DebugDraw, DebugDrawSettings, Extent, Film, RegionSeen, Seen, Source, Tie,
};
use crate::physics::RegionHost;
use crate::playback::ViewTime;
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::runtime::replace_file;
use crate::space::{BodyId, Bounds, Cell, DistributionTree, JointId, RegionId};

/// Drawing.
impl World {
    /// Draws the world by calling a renderer, `to`, with points, lines, boxes, shapes and text.
    ///
    /// A local world draws everything. A client or participant draws what it receives: shapes, borders,
    /// velocities, avatars and labels. A server draws the same from its record, which is half a second old,
    /// and joints. Only the process that computes a world knows the boxes around bodies, centres of mass,
    /// ghosts and contacts; the others leave them out. A node shows nothing of its world and returns an
    /// error.
    ///
    /// ```
    /// use dcd::prelude::*;
    /// use dcd::{DebugDraw, DebugDrawFlags, DebugDrawSettings};
    ///
    /// /// A renderer that only draws lines.
    /// #[derive(Default)]
    /// struct Lines(Vec<[[f64; 3]; 2]>);
    ///
    /// impl DebugDraw for Lines {
    ///     fn line(&mut self, from: [f64; 3], to: [f64; 3], _colour: [u8; 4]) {
    ///         self.0.push([from, to]);
    ///     }
    /// }
    ///
    /// let mut world = World::new(WorldConfig::default())?;
    /// world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(0.5, 0.5, 0.5))?;
    /// let mut lines = Lines::default();
    /// let what = DebugDrawFlags::SHAPES | DebugDrawFlags::AABBS;
    /// world.debug_draw(&mut lines, &DebugDrawSettings { what, ..DebugDrawSettings::default() })?;
    /// assert_eq!(lines.0.len(), 12 + 12);
    /// # Ok::<(), dcd::Error>(())
    /// ```
    pub fn debug_draw(
        &mut self,
        to: &mut (impl DebugDraw + ?Sized),
        settings: &DebugDrawSettings,
    ) -> Result<(), Error> {
        self.sees("be drawn")?;
        let mut canvas = std::mem::take(&mut self.canvas);
        canvas.draw(&Shown::of(self, settings.time), settings, to);
        self.canvas = canvas;
        Ok(())
    }

    /// Writes the world as it is after the last step to a binary glTF file (`.glb`), for papers, Blender and
    /// engines. Bodies are nodes named by their ids, with their shapes in the colour of the region that owns
    /// them. A file that is there is replaced once the new one is whole. A node shows nothing of its world
    /// and returns an error.
    ///
    /// ```
    /// use dcd::prelude::*;
    ///
    /// # let folder = tempfile::tempdir()?;
    /// # let path = folder.path().join("now.glb");
    /// let mut world = World::new(WorldConfig::default())?;
    /// world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5))?;
    /// world.save_gltf(&path)?;
    /// assert!(std::fs::read(&path)?.starts_with(b"glTF"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn save_gltf(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.sees("be drawn")?;
        let mut film = Film::default();
        film.look(&Shown::of(self, None), 0.0)?;
        Ok(replace_file(path.as_ref(), |file| film.write(BufWriter::new(file)))?)
    }
}

/// A world as it is drawn at one time.
struct Shown<'a> {
    world: &'a World,
    time: Option<ViewTime>,
    /// The host of the world's regions, in a local world.
    host: Option<&'a RegionHost>,
    bounds: Bounds,
    regions: Vec<RegionSeen>,
    places: BTreeMap<RegionId, u16>,
}

impl<'a> Shown<'a> {
    fn of(world: &'a World, time: Option<ViewTime>) -> Self {
        let host = world.alone().map(|world| world.host());
        let tree = world.remote().and_then(|remote| remote.tree());
        let tree = host.map(|host| host.partition().tree()).or(tree.as_ref());
        let seen =
            |(id, cell): (RegionId, Cell)| RegionSeen { id: id.0, node: None, ghosts: 0, step_ms: 0.0, cell };
        let cells: Vec<_> =
            tree.map(|tree| tree.leaves().map(|id| (id, tree.cell(id))).collect()).unwrap_or_default();
        let places = cells.iter().map(|(id, _)| *id).zip(0..).collect();
        let regions = cells.into_iter().map(seen).collect();
        let bounds = tree.map_or(Bounds::new([0.0; 3], [0.0; 3]), DistributionTree::bounds);
        Self { world, time, host, bounds, regions, places }
    }
}

impl Source for Shown<'_> {
    fn tick(&self) -> u64 {
        self.world.tick().0
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }

    fn for_each_movable(&self, mut look: impl FnMut(BodyId, Seen)) {
        let bodies = match &self.time {
            Some(time) => self.world.movable_bodies_at(time),
            None => self.world.movable_bodies(),
        };
        for body in bodies {
            let seen = Seen {
                at: body.pose.translation,
                turn: body.pose.rotation,
                velocity_m_s: body.velocity.linear,
                owner: self.places.get(&body.region).copied().unwrap_or(0),
                sleeping: body.sleeping,
                outside: body.outside,
                appearance: 0,
            };
            look(body.id, seen);
        }
    }

    fn for_each_fixed(&self, mut look: impl FnMut(BodyId, &WorldPose, u64)) {
        match (self.host, self.world.remote()) {
            (Some(host), _) => host.for_each_fixed(look),
            (None, Some(remote)) => remote.for_each_fixed(&mut |id, pose| look(id, pose, 0)),
            (None, None) => {}
        }
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        match self.host {
            Some(host) => host.record(id),
            None => self.world.remote()?.record(id),
        }
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        match self.host {
            Some(host) => host.shape(hash),
            None => self.world.remote()?.shape(hash),
        }
    }

    fn joints(&self) -> BTreeMap<JointId, Tie> {
        match (self.host, self.world.remote()) {
            (Some(host), _) => host.joints(),
            (None, Some(remote)) => remote.joints().iter().map(Tie::of).collect(),
            (None, None) => BTreeMap::new(),
        }
    }

    fn regions(&self) -> Vec<RegionSeen> {
        self.regions.clone()
    }

    fn ghost_boxes(&self) -> Vec<(u16, Bounds)> {
        self.host.map(Source::ghost_boxes).unwrap_or_default()
    }

    fn contacts(&self, most: usize) -> Vec<ContactSeen> {
        self.host.map(|host| host.contacts(most)).unwrap_or_default()
    }

    fn extent(&self, id: BodyId) -> Option<Extent> {
        self.host?.extent(id)
    }

    fn is_own(&self, id: BodyId) -> bool {
        id.client().is_some() && id.client() == self.world.client()
    }
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::*;
    use crate::DebugDrawFlags as Flag;
    use crate::DebugShape;
    use crate::runtime::{Partitioning, WorldConfig};
    use crate::space::Axis;

    /// The calls that a renderer received.
    #[derive(Debug, Default)]
    struct Drawn {
        points: Vec<([f64; 3], [u8; 4])>,
        lines: Vec<([[f64; 3]; 2], [u8; 4])>,
        boxes: Vec<(Bounds, [u8; 4])>,
        shapes: Vec<(BodyId, String, WorldPose, [u8; 4])>,
        texts: Vec<([f64; 3], String)>,
    }

    impl DebugDraw for Drawn {
        fn point(&mut self, at: [f64; 3], _size_px: f32, colour: [u8; 4]) {
            self.points.push((at, colour));
        }

        fn line(&mut self, from: [f64; 3], to: [f64; 3], colour: [u8; 4]) {
            self.lines.push(([from, to], colour));
        }

        fn aabb(&mut self, bounds: &Bounds, colour: [u8; 4]) {
            self.boxes.push((*bounds, colour));
        }

        fn shape(&mut self, body: BodyId, shape: &DebugShape<'_>, pose: &WorldPose, colour: [u8; 4]) {
            self.shapes.push((body, format!("{shape:?}"), *pose, colour));
        }

        fn text(&mut self, at: [f64; 3], text: &str, _colour: [u8; 4]) {
            self.texts.push((at, text.to_owned()));
        }
    }

    /// Makes a world of two regions, left and right of x = 0, with a floor.
    fn world() -> (World, BodyId) {
        let mut world = World::new(WorldConfig {
            partitioning: Partitioning::Cuts(vec![(Axis::X, 0.0)]),
            threads: 1,
            ..WorldConfig::default()
        })
        .unwrap();
        let floor = ColliderBuilder::cuboid(20.0, 0.5, 20.0).translation(Vector::new(0.0, -0.5, 0.0));
        let floor = world.insert(RigidBodyBuilder::fixed(), floor).unwrap();
        (world, floor)
    }

    fn cube(world: &mut World, at: [f32; 3]) -> BodyId {
        let body = RigidBodyBuilder::dynamic().translation(Vector::from_array(at));
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0)).unwrap()
    }

    fn drawn(world: &mut World, what: Flag) -> Drawn {
        let mut drawn = Drawn::default();
        let settings = DebugDrawSettings { what, ..DebugDrawSettings::default() };
        world.debug_draw(&mut drawn, &settings).unwrap();
        drawn
    }

    #[test]
    fn shapes_are_drawn_where_they_are_in_the_colour_of_their_owner() {
        let (mut world, floor) = world();
        let (left, right) = (cube(&mut world, [-3.0, 4.0, 0.0]), cube(&mut world, [3.0, 4.0, 0.0]));
        world.step().unwrap();
        let drawn = drawn(&mut world, Flag::SHAPES | Flag::LABELS);
        let [(a, shape, pose, grey), (b, _, b_at, blue), (c, _, c_at, yellow)] = &drawn.shapes[..] else {
            panic!("{drawn:?}");
        };
        assert_eq!((*a, *b, *c), (floor, left, right));
        assert_eq!((&shape[..], pose.translation), ("Box { half: [20.0, 0.5, 20.0] }", [0.0, -0.5, 0.0]));
        assert_eq!((Some(*b_at), Some(*c_at)), (world.pose(left), world.pose(right)));
        assert!(grey != blue && grey != yellow && blue != yellow, "{drawn:?}");
        assert_eq!(
            drawn.texts,
            [left, right].map(|id| (world.pose(id).unwrap().translation, id.to_string()))
        );
        assert!(drawn.points.is_empty() && drawn.lines.is_empty() && drawn.boxes.is_empty());
        while !world.body(left).unwrap().sleeping {
            world.step().unwrap();
        }
        let asleep = super::tests::drawn(&mut world, Flag::SHAPES);
        assert_ne!(asleep.shapes[1].3, *blue, "greyed");
    }

    #[test]
    fn boxes_hold_what_they_are_around_and_ghosts_are_drawn_by_who_holds_them() {
        let (mut world, _) = world();
        // A body that is inserted into a world that runs is shared at once.
        world.step().unwrap();
        let id = cube(&mut world, [-0.2, 0.5, 0.0]);
        world.set_velocity(id, crate::Velocity { linear: [6.0, 0.0, 0.0], angular: [0.0; 3] }).unwrap();
        let other = cube(&mut world, [0.9, 0.5, 0.0]);
        world.step().unwrap();
        let of = |world: &mut World, what| super::tests::drawn(world, what).boxes;
        let (tight, swept) = (of(&mut world, Flag::AABBS), of(&mut world, Flag::SWEPT_AABBS));
        let at = world.pose(id).unwrap().translation;
        assert!((0..3).all(|i| (tight[0].0.centre()[i] - at[i]).abs() < 0.02), "{tight:?}");
        assert!((tight[0].0.size()[1] - 1.0).abs() < 0.02, "{tight:?}");
        assert!(swept[0].0.contains(&tight[0].0) && swept[0].0.max[0] > tight[0].0.max[0] + 0.05);
        assert_eq!((tight.len(), swept.len()), (2, 2));
        let ghosts = of(&mut world, Flag::GHOSTS);
        assert!(world.owner(id).holders + world.owner(other).holders > 2, "something is shared");
        // The right region holds the ghost of a body that the left one owns.
        let holder = |bounds: &Bounds| if bounds.centre()[0] < 0.4 { tight[1].1 } else { tight[0].1 };
        assert!(
            !ghosts.is_empty() && ghosts.iter().all(|(bounds, colour)| *colour == holder(bounds)),
            "{ghosts:?}"
        );
        let regions = of(&mut world, Flag::BORDERS);
        let [(left, _), (right, _)] = regions[..] else { panic!("{regions:?}") };
        assert_eq!((left.max[0], right.min[0]), (0.0, 0.0));
        assert_eq!((left.min[0], right.max[0]), (-64.0, 64.0), "within the bounds of the world");
    }

    #[test]
    fn contacts_joints_velocities_and_centres_are_drawn_to_scale() {
        let (mut world, floor) = world();
        let standing = cube(&mut world, [-3.0, 0.5, 0.0]);
        let hung = cube(&mut world, [5.0, 5.0, 0.0]);
        let joint = SphericalJointBuilder::new()
            .local_anchor1(Vector::new(5.0, 8.0, 0.0))
            .local_anchor2(Vector::new(0.0, 3.0, 0.0));
        world.insert_joint(floor, hung, joint).unwrap();
        for _ in 0..30 {
            world.step().unwrap();
        }
        let mut all = Drawn::default();
        let settings =
            DebugDrawSettings { what: Flag::CONTACTS, metres_per_n: 1e-3, ..DebugDrawSettings::default() };
        world.debug_draw(&mut all, &settings).unwrap();
        let up: f64 = all.lines.iter().map(|([from, to], _)| (to[1] - from[1]).abs()).sum();
        assert!((up - 9.81).abs() < 0.3, "a tonne presses by 9.81 kN: {all:?}");
        assert!(all.points.iter().all(|(at, _)| at[1].abs() < 0.02 && (at[0] + 3.0).abs() < 0.6), "{all:?}");

        let joints = drawn(&mut world, Flag::JOINTS).lines;
        assert_eq!(joints.len(), 3);
        let [from, to] = joints[1].0;
        assert!(
            (0..3).all(|i| (from[i] - [5.0, 8.0, 0.0][i]).abs() < 1e-3 && (from[i] - to[i]).abs() < 0.05)
        );

        world.set_velocity(standing, crate::Velocity { linear: [0.0, 0.0, 4.0], angular: [0.0; 3] }).unwrap();
        let arrows = drawn(&mut world, Flag::VELOCITIES).lines;
        let own = arrows.iter().find(|([from, _], _)| from[0] < 0.0).expect("it moves");
        assert!((own.0[1][2] - own.0[0][2] - 0.4).abs() < 1e-3, "{own:?}");
        let centres = drawn(&mut world, Flag::CENTRES_OF_MASS).points;
        let at = world.pose(standing).unwrap().translation;
        assert!((0..3).all(|i| (centres[0].0[i] - at[i]).abs() < 1e-5), "{centres:?}");
    }

    #[test]
    fn a_contact_over_a_border_is_drawn_once() {
        let cuts = Partitioning::Cuts(vec![(Axis::X, 0.0)]);
        let mut world =
            World::new(WorldConfig { partitioning: cuts, threads: 1, ..WorldConfig::default() }).unwrap();
        for side in [-1.0, 1.0] {
            let body = RigidBodyBuilder::dynamic()
                .translation(Vector::new(0.499 * side, 0.0, 0.0))
                .linvel(Vector::new(-0.1 * side, 0.0, 0.0))
                .gravity_scale(0.0);
            world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap();
        }
        for _ in 0..3 {
            world.step().unwrap();
            let drawn = drawn(&mut world, Flag::CONTACTS);
            assert_eq!(drawn.points.len(), 1, "{drawn:?}");
        }
    }

    #[test]
    fn what_lies_elsewhere_is_left_out_and_the_time_to_show_is_kept_to() {
        let (mut world, _) = world();
        cube(&mut world, [-3.0, 40.0, 0.0]);
        let right = cube(&mut world, [3.0, 40.0, 0.0]);
        world.view_time();
        world.step().unwrap();
        let settings = DebugDrawSettings {
            what: Flag::SHAPES | Flag::LABELS,
            time: Some(ViewTime::new(1.0, 0.5)),
            within: Some(Bounds::new([0.0; 3], [50.0; 3])),
            ..DebugDrawSettings::default()
        };
        let mut drawn = Drawn::default();
        world.debug_draw(&mut drawn, &settings).unwrap();
        assert_eq!(drawn.shapes.len(), 2, "the floor and one cube");
        let halfway = world.motion_at(right, 0.5).unwrap().0;
        assert_eq!((drawn.shapes[1].0, drawn.shapes[1].2), (right, halfway));
        assert_ne!(Some(halfway), world.pose(right));
        assert_eq!(drawn.texts.len(), 1);
    }

    #[test]
    fn a_mesh_keeps_its_number() {
        let (mut world, _) = world();
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector::from_array);
        let hull = ColliderBuilder::convex_hull(&corners).unwrap();
        let id = world.insert(RigidBodyBuilder::dynamic(), hull.clone()).unwrap();
        let first = drawn(&mut world, Flag::SHAPES).shapes[1].1.clone();
        assert!(first.starts_with("Mesh { number: 0,"), "{first}");
        let other = hull.translation(Vector::new(5.0, 0.0, 0.0));
        world.insert(RigidBodyBuilder::dynamic(), other).unwrap();
        let again = drawn(&mut world, Flag::SHAPES).shapes;
        assert_eq!((&again[1].1, &again[2].1), (&first, &first));
        assert_eq!(again[2].2.translation, [5.0, 0.0, 0.0]);
        assert_eq!(again[1].0, id);
    }

    /// Prints what drawing costs, where nothing else runs
    /// (`cargo test -p dcd --lib drawing -- --ignored --nocapture`).
    #[test]
    #[ignore = "measures"]
    fn twenty_thousand_bodies_are_drawn_within_a_frame() {
        let scene = crate::scene::Scene::named("pile", &crate::Params::new().with("n", 20_000)).unwrap();
        let config = WorldConfig { partitioning: Partitioning::Regions(4), ..WorldConfig::for_scene(&scene) };
        let mut world = World::from_scene(&scene, config).unwrap();
        world.step().unwrap();
        let mut least = [std::time::Duration::MAX; 2];
        for (what, least) in [Flag::SHAPES, Flag::ALL].into_iter().zip(&mut least) {
            for _ in 0..5 {
                let start = std::time::Instant::now();
                let drawn = drawn(&mut world, what);
                *least = (*least).min(start.elapsed());
                assert!(drawn.shapes.len() > 20_000);
            }
        }
        println!("shapes {:?}, all {:?}", least[0], least[1]);
    }
}
