//! Takes the picture of the README: a world in four regions, as the viewer's page shows it in a headless Chromium.
//!
//! `cargo run -p dcd-tests --example picture -- dcd/manual/world.png`

use std::error::Error;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use dcd::Viewer;
use dcd::prelude::*;
use dcd_tests::browser::Browser;

/// CSS pixels, and how many pixels one of these is.
const SIZE: (u32, u32) = (1180, 520);
const SCALE: f64 = 1.0;
/// From where it is seen, and what of it.
const LOOK: &str = "bare&theme=light&show=borders,ghosts&yaw=0.62&pitch=0.42&distance=27&target=0,0.6,0.6";
/// Ticks before the picture.
const TICKS: u32 = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args().nth(1).ok_or("name the file to write")?;
    let mut world = World::new(WorldConfig {
        bounds: Bounds::new([-40.0, -2.0, -40.0], [40.0, 10.0, 40.0]),
        partitioning: Partitioning::Regions(4),
        ..WorldConfig::default()
    })?;
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(60.0, 0.5, 60.0))?;
    rain(&mut world)?;
    for _ in 0..TICKS {
        world.step()?;
    }
    let mut viewer = Viewer::open(([127, 0, 0, 1], 0).into(), "rain")?;
    let url = format!("{}#{LOOK}", viewer.url());
    let done = AtomicBool::new(false);
    let size = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::SeqCst) {
                viewer.show(&world).expect("a local world can be shown");
                std::thread::park_timeout(Duration::from_millis(10));
            }
        });
        let taken = taken(&url, Path::new(&out));
        done.store(true, Ordering::SeqCst);
        taken
    })?;
    println!("{out}: {} bodies in {} regions, {size} bytes", world.movable_count(), world.region_count());
    Ok(())
}

fn taken(url: &str, out: &Path) -> Result<usize, Box<dyn Error>> {
    let mut browser =
        Browser::start(SIZE.0, SIZE.1).ok_or("no Chromium on this machine: apt-get install chromium")?;
    browser.resize(SIZE.0, SIZE.1, SCALE);
    browser.open(url, "light");
    browser.until("window.dcd.counters.bodies > 0 && window.dcd.counters.smooth");
    Ok(browser.keep_picture(out).len())
}

/// Shapes that fall in a spiral round the corner of the four regions, and blow outwards.
fn rain(world: &mut World) -> Result<(), dcd::Error> {
    for i in 0..420_u16 {
        let (turn, out) = (f32::from(i) * 2.399_963, 0.56 * f32::from(i).sqrt());
        let at = Vector::new(1.7 * out * turn.cos(), 1.0 + f32::from(i % 7), 0.9 * out * turn.sin());
        let body = RigidBodyBuilder::dynamic().translation(at).linvel(Vector::new(at.z, 0.0, -at.x) * 0.4);
        let shape = match i % 9 {
            0..=4 => ColliderBuilder::cuboid(0.4, 0.4, 0.4),
            5 | 6 => ColliderBuilder::ball(0.42),
            7 => ColliderBuilder::capsule_y(0.3, 0.3),
            _ => ColliderBuilder::cylinder(0.35, 0.4),
        };
        world.insert(body, shape)?;
    }
    Ok(())
}
