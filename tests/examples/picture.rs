//! Takes the picture of the README: a world in four regions, as the viewer's page shows it in a headless
//! Chromium.
//!
//! `cargo run -p dcd-tests --example picture -- dcd/manual/world.png`

use std::collections::BTreeMap;
use std::error::Error;
use std::io::Cursor;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use dcd::Viewer;
use dcd::prelude::*;
use dcd_tests::browser::Browser;

/// The size of the window in CSS pixels, and the number of device pixels per CSS pixel.
const SIZE: (u32, u32) = (1200, 520);
const SCALE: f64 = 1.0;
/// The query of the viewer's page: the camera, and what is shown.
const LOOK: &str = "bare&theme=light&show=borders,ghosts&yaw=0.62&pitch=0.5&distance=25&target=0,0,0.8";
/// The number of ticks before the picture is taken.
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
    let picture = smaller(&browser.picture())?;
    std::fs::write(out, &picture)?;
    Ok(picture.len())
}

/// Encodes a picture again with a palette of its 256 most frequent colours.
fn smaller(picture: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut reader = png::Decoder::new(Cursor::new(picture)).read_info()?;
    let mut bytes = vec![0; reader.output_buffer_size().ok_or("a picture too large")?];
    let info = reader.next_frame(&mut bytes)?;
    let pixels = || bytes.chunks_exact(info.color_type.samples()).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    // Similar colours share one palette entry: their mean.
    let like = |colour: [u8; 3]| colour.map(|v| v / 6);
    let mut buckets = BTreeMap::<[u8; 3], (u64, [u64; 3])>::new();
    for colour in pixels() {
        let (count, sums) = buckets.entry(like(colour)).or_default();
        *count += 1;
        sums.iter_mut().zip(colour).for_each(|(sum, v)| *sum += u64::from(v));
    }
    let mut most: Vec<_> = buckets.values().collect();
    most.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let palette: Vec<[u8; 3]> =
        most.iter().take(256).map(|(count, sums)| sums.map(|sum| (sum / count) as u8)).collect();
    let far = |a: &[u8; 3], b: &[u8; 3]| (0..3).map(|i| i32::from(a[i].abs_diff(b[i])).pow(2)).sum::<i32>();
    let mut places = BTreeMap::new();
    let nearest =
        |colour: &[u8; 3]| (0..palette.len()).min_by_key(|&at| far(&palette[at], colour)).unwrap_or(0);
    let indexed: Vec<u8> = pixels()
        .map(|colour| *places.entry(like(colour)).or_insert_with(|| nearest(&colour)) as u8)
        .collect();
    let mut small = Vec::new();
    let mut encoder = png::Encoder::new(&mut small, info.width, info.height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(palette.concat());
    encoder.set_compression(png::Compression::High);
    encoder.write_header()?.write_image_data(&indexed)?;
    Ok(small)
}

/// Inserts shapes that fall in a spiral round the corner of the four regions, and blows them outwards.
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
