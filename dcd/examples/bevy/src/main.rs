//! Plays in a served world that Bevy draws: `dcd-bevy SERVER TOKEN [--screenshot FILE]`.
//!
//! The player is a character that walks (W A S D), jumps (space) and pushes what is in its way. A colour stands for the region that owns
//! a body; pale bodies are asleep. With `--screenshot` the character walks some metres ahead by itself, and a picture of that ends the
//! program.
//!
//! The served world is a resource. `FixedUpdate` has its steps: they send what the player wants, and take in what has come. Bodies that
//! appear become entities; entities of removed bodies are removed. `Update` puts the entities where the world is to be shown by now: the
//! avatar, and what it touches, ahead of what was heard, all others a moment behind, smoothly.

mod shapes;

use std::collections::HashMap;
use std::path::PathBuf;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use dcd::network::JoinConfig;
use dcd::prelude::{ColliderBuilder, RigidBodyBuilder};
use dcd::query::ShapeHash;
use dcd::{Area, BodyChange, BodyId, BodyKind, Character, RegionId, Velocity, ViewTime, WorldPose};

/// Metres per second along the ground.
const SPEED: f32 = 5.0;
/// Metres per second upwards.
const JUMP: f32 = 6.0;
/// Metres around the player within which bodies are told and drawn.
const SIGHT_M: f64 = 80.0;
/// Metres that the player goes by itself for a picture.
const STROLL_M: f32 = 12.0;
/// Frames from the end of that walk until the picture is taken, in which all comes to rest.
const FRAMES: u32 = 10;

/// The colours of regions, by their numbers.
const PALETTE: [[u8; 3]; 8] = [
    [230, 92, 70],
    [92, 178, 106],
    [82, 136, 228],
    [236, 188, 72],
    [170, 108, 214],
    [72, 190, 196],
    [236, 138, 176],
    [160, 168, 82],
];

/// The served world, and what Bevy made of it.
#[derive(Resource)]
struct Served {
    world: dcd::World,
    avatar: BodyId,
    /// The pose in which the avatar is shown. Everything is drawn relative to it: world space has doubles,
    /// and a renderer has floats.
    player: WorldPose,
    /// The ticks that this frame shows.
    time: ViewTime,
    moved_m: f32,
    entities: HashMap<BodyId, Entity>,
    /// Equal shapes have one hash, so that their meshes are made once.
    meshes: HashMap<ShapeHash, Vec<(Handle<Mesh>, Transform)>>,
}

/// The file of the picture that the command line asks for.
#[derive(Resource)]
struct Picture(Option<PathBuf>);

/// An entity that stands for a body; its colliders are its children.
#[derive(Component)]
struct Body(BodyId);

/// The line of figures.
#[derive(Component)]
struct Figures;

/// The colours of the regions, awake and asleep, of the avatar, and of what never moves.
#[derive(Resource)]
struct Paints {
    regions: Vec<[Handle<StandardMaterial>; 2]>,
    avatar: Handle<StandardMaterial>,
    scenery: Handle<StandardMaterial>,
}

impl Paints {
    fn of(&self, region: RegionId, sleeping: bool) -> &Handle<StandardMaterial> {
        &self.regions[region.0 as usize % self.regions.len()][usize::from(sleeping)]
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let usage = "usage: dcd-bevy SERVER TOKEN [--screenshot FILE]";
    let (Some(server), Some(token)) = (words.next(), words.next()) else { return Err(usage.into()) };
    let picture = match words.next().as_deref() {
        None => None,
        Some("--screenshot") => Some(PathBuf::from(words.next().ok_or(usage)?)),
        Some(_) => return Err(usage.into()),
    };
    let served = join(&JoinConfig::new(server.parse()?, token))?;
    let tick_s = f64::from(served.world.dt_s());
    let window = Window { title: "dcd".to_owned(), resolution: (1280, 720).into(), ..default() };
    App::new()
        .add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .insert_resource(ClearColor(Color::srgb(0.62, 0.74, 0.86)))
        .insert_resource(GlobalAmbientLight { brightness: 1_000.0, ..default() })
        .insert_resource(Time::<Fixed>::from_seconds(tick_s))
        .insert_resource(served)
        .insert_resource(Picture(picture))
        .add_systems(Startup, (set_up, take_in).chain())
        .add_systems(FixedUpdate, (drive, step).chain())
        .add_systems(Update, (show, look, tell, take_picture).chain())
        .run();
    Ok(())
}

/// Joins as a client, and asks for an avatar in front of all that moves, from where it falls to the ground.
fn join(config: &JoinConfig) -> Result<Served, dcd::Error> {
    let mut world = dcd::World::connect(config)?;
    let front = world.movable_bodies().map(|body| body.pose.translation[2]).fold(0.0, f64::max);
    let player = WorldPose::at([0.0, 3.0, front + 4.0]);
    let body = RigidBodyBuilder::kinematic_velocity_based();
    let avatar = world.insert_character(
        player,
        &Character::default(),
        body,
        [ColliderBuilder::capsule_y(0.5, 0.4)],
    )?;
    let time = ViewTime::new(0.0, 0.0);
    Ok(Served { world, avatar, player, time, moved_m: 0.0, entities: HashMap::new(), meshes: HashMap::new() })
}

fn set_up(mut commands: Commands, mut materials: ResMut<Assets<StandardMaterial>>) {
    commands.spawn((
        DirectionalLight { illuminance: 5_500.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(0.5, 0.9, 0.4).looking_at(Vec3::ZERO, Vec3::Y),
        CascadeShadowConfigBuilder { first_cascade_far_bound: 15.0, maximum_distance: 90.0, ..default() }
            .build(),
    ));
    let fog = FogFalloff::Linear { start: 60.0, end: 250.0 };
    commands.spawn((
        Camera3d::default(),
        Projection::Perspective(PerspectiveProjection { fov: 60.0_f32.to_radians(), ..default() }),
        Tonemapping::AcesFitted,
        DistanceFog { color: Color::srgb(0.62, 0.74, 0.86), falloff: fog, ..default() },
    ));
    commands.spawn((
        Figures,
        Text::default(),
        TextFont::from_font_size(16.0),
        Node { position_type: PositionType::Absolute, top: px(8), left: px(12), ..default() },
    ));
    let mut paint = |colour: Color| {
        materials.add(StandardMaterial { base_color: colour, perceptual_roughness: 0.8, ..default() })
    };
    let regions = PALETTE.map(|[r, g, b]| {
        let awake = Color::srgb_u8(r, g, b);
        [awake, awake.mix(&Color::srgb_u8(130, 130, 130), 0.45)].map(&mut paint)
    });
    let regions = regions.to_vec();
    let (avatar, scenery) = (paint(Color::WHITE), paint(Color::srgb(0.62, 0.63, 0.60)));
    commands.insert_resource(Paints { regions, avatar, scenery });
}

/// Makes entities of the bodies that the world has on joining.
fn take_in(
    mut served: ResMut<Served>,
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    paints: Res<Paints>,
) {
    for body in served.world.bodies() {
        add(&mut served, body, &mut commands, &mut meshes, &paints);
    }
}

/// Makes an entity of a body, unless it is one.
fn add(served: &mut Served, id: BodyId, commands: &mut Commands, meshes: &mut Assets<Mesh>, paints: &Paints) {
    let Some(record) = served.world.record(id) else { return };
    if served.entities.contains_key(&id) {
        return;
    }
    let paint = match record.traits.kind {
        _ if id == served.avatar => &paints.avatar,
        BodyKind::Fixed => &paints.scenery,
        _ => paints.of(RegionId(0), false),
    };
    let mut entity = commands.spawn((Body(id), Transform::default(), Visibility::default()));
    for (index, collider) in record.traits.colliders.iter().enumerate() {
        if collider.sensor || !collider.enabled {
            continue;
        }
        let parts = served.meshes.entry(collider.shape).or_insert_with(|| {
            let shape = served.world.shape((id, index));
            let parts = shape.map(|shape| shapes::meshes(&*shape)).unwrap_or_default();
            parts.into_iter().map(|(mesh, at)| (meshes.add(mesh), at)).collect()
        });
        let place = Transform::from_translation(Vec3::from_array(collider.pose.translation))
            .with_rotation(Quat::from_array(collider.pose.rotation));
        for (mesh, at) in parts {
            entity.with_child((Mesh3d(mesh.clone()), MeshMaterial3d(paint.clone()), place * *at));
        }
    }
    served.entities.insert(id, entity.id());
}

/// Asks the avatar to go where the keys say.
fn drive(mut served: ResMut<Served>, keys: Res<ButtonInput<KeyCode>>, picture: Res<Picture>) -> Result {
    let by_itself = picture.0.is_some() && served.moved_m < STROLL_M;
    let pressed = |key, scale: f32| if keys.pressed(key) { scale } else { 0.0 };
    let along = if by_itself { -1.0 } else { pressed(KeyCode::KeyS, 1.0) - pressed(KeyCode::KeyW, 1.0) };
    let aside = pressed(KeyCode::KeyD, 1.0) - pressed(KeyCode::KeyA, 1.0);
    let ground = Vec2::new(aside, along).clamp_length_max(1.0) * SPEED;
    let wish = Velocity::linear([ground.x, pressed(KeyCode::Space, JUMP), ground.y]);
    let (avatar, area) = (served.avatar, Area { centre: served.player.translation, radius_m: SIGHT_M });
    served.world.set_velocity(avatar, wish)?;
    Ok(served.world.set_interest(Some(area))?)
}

/// Makes one step, which sends what was asked and takes in what has come, and follows who came and went.
fn step(
    mut served: ResMut<Served>,
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    paints: Res<Paints>,
) -> Result {
    served.world.step()?;
    for change in served.world.changes().to_vec() {
        match change {
            BodyChange::Appeared(id) => add(&mut served, id, &mut commands, &mut meshes, &paints),
            BodyChange::Removed { body, .. } => {
                if let Some(entity) = served.entities.remove(&body) {
                    commands.entity(entity).despawn();
                }
            }
            refused => warn!("{refused:?}"),
        }
    }
    Ok(())
}

/// Puts each entity where its body is shown in this frame, in the colour of its owner.
fn show(
    mut served: ResMut<Served>,
    paints: Res<Paints>,
    mut bodies: Query<(&Body, &mut Transform, &mut Visibility, &Children)>,
    mut painted: Query<&mut MeshMaterial3d<StandardMaterial>>,
) {
    let time = served.world.view_time();
    served.time = time;
    if let Some((pose, _)) = served.world.motion_at(served.avatar, time.predicted) {
        let way = relative(&pose, &served.player).translation;
        served.moved_m += Vec2::new(way.x, way.z).length();
        served.player = pose;
    }
    for (body, mut transform, ..) in &mut bodies {
        if let Some(pose) = served.world.pose(body.0) {
            *transform = relative(&pose, &served.player);
        }
    }
    for body in served.world.movable_bodies_at(&time) {
        let Some(&entity) = served.entities.get(&body.id) else { continue };
        let Ok((_, mut transform, mut visibility, children)) = bodies.get_mut(entity) else { continue };
        *transform = relative(&body.pose, &served.player);
        *visibility = if body.outside { Visibility::Hidden } else { Visibility::Inherited };
        if body.id != served.avatar {
            let paint = paints.of(body.region, body.sleeping);
            for child in children {
                if let Ok(mut material) = painted.get_mut(*child)
                    && material.0 != *paint
                {
                    material.0 = paint.clone();
                }
            }
        }
    }
}

/// A place in the world as the renderer has it.
fn relative(pose: &WorldPose, origin: &WorldPose) -> Transform {
    let at = [0, 1, 2].map(|axis| (pose.translation[axis] - origin.translation[axis]) as f32);
    Transform::from_translation(Vec3::from_array(at)).with_rotation(Quat::from_array(pose.rotation))
}

/// Keeps the camera behind the player, who is where the renderer has its origin.
fn look(mut camera: Single<&mut Transform, With<Camera3d>>) {
    **camera = Transform::from_xyz(0.0, 5.3, 10.0).looking_at(Vec3::Y, Vec3::Y);
}

/// Shows how far behind and ahead the world is drawn, and what it costs.
fn tell(served: Res<Served>, mut text: Single<&mut Text, With<Figures>>) {
    let ms = |ticks: f64| 1e3 * f64::from(served.world.dt_s()) * ticks;
    text.0 = format!(
        "tick {}   {} bodies   shown {:.0} ms behind, you {:.0} ms ahead   {} kB received",
        served.world.tick().0,
        served.entities.len(),
        ms(served.time.now - served.time.shown),
        ms(served.time.predicted - served.time.now),
        served.world.traffic().bytes_in / 1000,
    );
}

/// Takes the picture that was asked for, and leaves.
fn take_picture(mut commands: Commands, served: Res<Served>, picture: Res<Picture>, mut frames: Local<u32>) {
    *frames += u32::from(served.moved_m >= STROLL_M);
    if let Some(path) = picture.0.as_ref().filter(|_| *frames == FRAMES) {
        commands.spawn(Screenshot::primary_window()).observe(save_to_disk(path.clone())).observe(
            |_: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
                exit.write(AppExit::Success);
            },
        );
    }
}
