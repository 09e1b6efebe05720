use dcd::runtime::*;
use dcd::scene::*;
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let name = &a[1];
    let regions: usize = a[2].parse().unwrap();
    let threads: usize = a[3].parse().unwrap();
    let steps: usize = a[4].parse().unwrap();
    let mut p = Params::default();
    for kv in &a[5..] {
        let (k, v) = kv.split_once('=').unwrap();
        p.set(k, v);
    }
    let scene = Scene::open(name, &p).unwrap();
    let mut ts = vec![];
    if regions == 0 {
        let mut w = scene.bare_world();
        for _ in 0..steps {
            let t = Instant::now();
            w.step();
            ts.push(t.elapsed().as_secs_f64() * 1e3);
        }
    } else {
        let c = WorldConfig {
            partitioning: Partitioning::Regions(regions),
            threads,
            ..WorldConfig::for_scene(&scene)
        };
        let mut w = DcdWorld::from_scene(&scene, c).unwrap();
        for i in 0..steps {
            let t = Instant::now();
            w.step().unwrap();
            ts.push(t.elapsed().as_secs_f64() * 1e3);
            if i % 100 == 0 {
                let s = w.stats();
                eprintln!(
                    "{i} replicas {} transfers {} bodies {} halo {:.2} q {}",
                    s.replicas,
                    s.transfers,
                    s.bodies,
                    w.host().partition().halo_m(),
                    s.quarantined
                );
            }
        }
        println!("hash {:016x} {:?}", w.state_hash(), w.stats());
        let mut owners = std::collections::BTreeMap::new();
        for (id, ..) in w.states() {
            *owners.entry(w.owners_of(id)).or_insert(0) += 1;
        }
        println!("owners {owners:?}");
    }
    let n = ts.len();
    let warm = &mut ts[30.min(n / 2)..];
    let mean = warm.iter().sum::<f64>() / warm.len() as f64;
    warm.sort_by(|a, b| a.total_cmp(b));
    println!(
        "{name} regions {regions} threads {threads}: mean {:.3} p50 {:.3} p99 {:.3}",
        mean,
        warm[warm.len() / 2],
        warm[warm.len() * 99 / 100]
    );
}
