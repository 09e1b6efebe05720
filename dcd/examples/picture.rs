//! Draws a cut world from above as SVG: bodies by the colour of the region that owns them, and the planes that cut it. The picture
//! of the README is made so.
//!
//! `cargo run --release -p dcd --example picture -- OUT.svg`

use std::error::Error;
use std::fmt::Write;

use dcd::prelude::*;

const COLOURS: [&str; 4] = ["#4269d0", "#efb118", "#3ca951", "#ff725c"];
/// Pixels per metre, and the half width and half height that are drawn, metres.
const SCALE: f64 = 14.0;
const HALF_M: [f64; 2] = [26.0, 13.0];

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args().nth(1).ok_or("name the file to write")?;
    let mut world = World::new(WorldConfig {
        bounds: Bounds::new([-40.0, -2.0, -40.0], [40.0, 10.0, 40.0]),
        partitioning: Partitioning::Regions(4),
        ..WorldConfig::default()
    })?;
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(60.0, 0.5, 60.0))?;
    rain(&mut world)?;
    for _ in 0..120 {
        world.step()?;
    }
    std::fs::write(&out, drawn(&world)?)?;
    println!("{out}: {} bodies in {} regions", world.movable_count(), world.region_count());
    Ok(())
}

/// Boxes that fall in a spiral round the corner of the four regions, and blow outwards.
fn rain(world: &mut World) -> Result<(), dcd::Error> {
    for i in 0..420_u16 {
        let (turn, out) = (f32::from(i) * 2.399_963, 0.56 * f32::from(i).sqrt());
        let at = Vector::new(1.7 * out * turn.cos(), 1.0 + f32::from(i % 7), 0.9 * out * turn.sin());
        let body = RigidBodyBuilder::dynamic().translation(at).linvel(Vector::new(at.z, 0.0, -at.x) * 0.4);
        world.insert(body, ColliderBuilder::cuboid(0.4, 0.4, 0.4))?;
    }
    Ok(())
}

fn drawn(world: &World) -> Result<String, Box<dyn Error>> {
    let [width, height] = HALF_M.map(|half| 2.0 * half * SCALE);
    let px = |at: [f64; 3]| [(at[0] + HALF_M[0]) * SCALE, (at[2] + HALF_M[1]) * SCALE];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fbfaf7\"/>\n"
    );
    let regions = world.regions();
    for (region, colour) in regions.iter().zip(COLOURS.iter().cycle()) {
        let [left, top] = px(region.cell.min.map(|v| v.clamp(-100.0, 100.0)));
        let [right, bottom] = px(region.cell.max.map(|v| v.clamp(-100.0, 100.0)));
        let (w, h) = (right - left, bottom - top);
        writeln!(
            svg,
            "<rect x=\"{left:.0}\" y=\"{top:.0}\" width=\"{w:.0}\" height=\"{h:.0}\" fill=\"{colour}\" fill-opacity=\".07\" \
             stroke=\"#555\" stroke-dasharray=\"7 5\"/>"
        )?;
    }
    for body in world.movable_bodies() {
        let place = regions.iter().position(|region| region.id == body.region).unwrap_or(0);
        let (colour, [x, y]) = (COLOURS[place % COLOURS.len()], px(body.pose.translation));
        // Held by several regions: a contact here is solved over a border.
        let shared = if world.owner(body.id).holders > 1 { "stroke=\"#222\" stroke-width=\"2\"" } else { "" };
        let [qx, qy, qz, qw] = body.pose.rotation.map(f64::from);
        let turn = -(2.0 * (qx * qz + qw * qy)).atan2(1.0 - 2.0 * (qy * qy + qx * qx)).to_degrees();
        let half = 0.4 * SCALE;
        writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"1.5\" fill=\"{colour}\" fill-opacity=\".85\" {shared} \
             transform=\"rotate({turn:.0} {x:.1} {y:.1})\"/>",
            x - half,
            y - half,
            2.0 * half,
            2.0 * half,
        )?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}
