use dcd::physics::*;
use dcd::runtime::*;
use dcd::scene::*;
use dcd::space::*;
fn main() {
    let scene = Scene::named("tower", &Params::new()).unwrap();
    let mut config = WorldConfig { partitioning: Partitioning::Cuts(vec![(Axis::Y, 4.5)]), ..WorldConfig::for_scene(&scene) };
    config.step = config.step.with_coupling(Coupling::Island);
    config.step.exchanges = 1;
    let mut world = DcdWorld::from_scene(&scene, config).unwrap();
    for t in 0..240 {
        world.step().unwrap();
        if t % 30 == 29 || (t > 14 && t < 24) {
            println!("tick {t}");
            for region in world.regions() {
                let mut all: Vec<_> = region.bodies().collect();
                all.sort_by_key(|x| x.0);
                for (id, role, h, b) in all {
                    if b.is_fixed() { continue; }
                    println!("  {} {id} {role:?} y={:.4} v={:.5} w={:.5} m={} parts={} f={:?} sleep={} t={:.2}", region.id(), b.translation().y, b.linvel().y, b.angvel().length(), b.mass(), region.share_of(h), b.user_force().y, b.is_sleeping(), b.activation().time_since_can_sleep);
                }
            }
        }
    }
}
