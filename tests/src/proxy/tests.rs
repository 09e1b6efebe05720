//! Tests the proxy: order, loss, delay, duplicates, cuts, and ports that are released.

use super::*;

/// A sender and a receiver of numbered packets.
struct Pair {
    proxy: Proxy,
    front: SocketAddr,
    near: UdpSocket,
    far: UdpSocket,
}

const PATIENCE: Duration = Duration::from_secs(10);
const MILLISECOND: Duration = Duration::from_millis(1);

impl Pair {
    fn new(seed: u64, weather: Weather) -> Self {
        let proxy = Proxy::start(seed);
        let [near, far] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        let front = proxy.front(far.local_addr().unwrap());
        proxy.set(weather);
        Self { proxy, front, near, far }
    }

    fn send(&self, number: u32) {
        self.near.send_to(&number.to_le_bytes(), self.front).unwrap();
    }

    /// Returns the next number that arrives within `limit`, and its sender.
    fn receive(socket: &UdpSocket, limit: Duration) -> Option<(u32, SocketAddr)> {
        let mut bytes = [0; 4];
        socket.set_read_timeout(Some(limit)).unwrap();
        match socket.recv_from(&mut bytes) {
            Ok((length, from)) => {
                assert_eq!(length, 4);
                Some((u32::from_le_bytes(bytes), from))
            }
            Err(_) => None,
        }
    }

    /// Sends packets in groups that fit every socket's buffer. Returns the numbers of those that arrived.
    fn arrived(&self, count: u32) -> Vec<u32> {
        let mut arrived = Vec::new();
        for number in 0..count {
            self.send(number);
            if number % 50 == 49 || number + 1 == count {
                let deadline = Instant::now() + PATIENCE;
                let is_through = || {
                    let Traffic { taken, passed, lost, cut, doubled, .. } = self.proxy.traffic();
                    taken == u64::from(number) + 1 && passed + lost + cut == taken + doubled
                };
                while !is_through() {
                    assert!(Instant::now() < deadline, "{:?}", self.proxy.traffic());
                    arrived.extend(Self::receive(&self.far, MILLISECOND).map(|(number, _)| number));
                }
                // On loopback a packet has arrived once it is sent.
                while let Some((number, _)) = Self::receive(&self.far, MILLISECOND) {
                    arrived.push(number);
                }
            }
        }
        arrived
    }
}

#[test]
fn in_clear_weather_all_arrives_in_order_and_answers_find_their_way() {
    let pair = Pair::new(1, Weather::default());
    assert_eq!(pair.arrived(500), (0..500).collect::<Vec<_>>());
    // Two senders are two flows, each with a way back.
    let other = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut seen = Vec::new();
    for (sender, number) in [(&pair.near, 7_u32), (&other, 8)] {
        sender.send_to(&number.to_le_bytes(), pair.front).unwrap();
        let (heard, from) = Pair::receive(&pair.far, PATIENCE).unwrap();
        assert_eq!(heard, number);
        seen.push(from);
        pair.far.send_to(&(number + 10).to_le_bytes(), from).unwrap();
        assert_eq!(Pair::receive(sender, PATIENCE), Some((number + 10, pair.front)));
    }
    assert_ne!(seen[0], seen[1]);
}

#[test]
fn losses_are_as_many_as_asked_for_and_the_seeds() {
    let lossy = Weather { loss: 0.05, ..Weather::default() };
    let [first, again, other] = [1, 1, 2].map(|seed| Pair::new(seed, lossy).arrived(4_000));
    let lost = 1.0 - first.len() as f64 / 4_000.0;
    assert!((0.04..0.06).contains(&lost), "{lost}");
    assert_eq!(first, again);
    assert_ne!(first, other);
}

#[test]
fn some_are_overtaken_and_some_come_twice() {
    let weather = Weather { reorder: 0.1, duplicate: 0.05, ..Weather::default() };
    let pair = Pair::new(1, weather);
    let arrived = pair.arrived(1_000);
    let traffic = pair.proxy.traffic();
    assert_eq!(arrived.len() as u64, 1_000 + traffic.doubled);
    assert!((25..100).contains(&traffic.doubled) && (50..200).contains(&traffic.reordered), "{traffic:?}");
    let back = arrived.windows(2).filter(|pair| pair[1] < pair[0]).count();
    assert!(back >= 10, "only {back} came after one that was sent later");
    let mut all = arrived;
    all.sort_unstable();
    all.dedup();
    assert_eq!(all, (0..1_000).collect::<Vec<_>>());
}

#[test]
fn delays_are_as_long_as_asked_for_and_keep_the_order() {
    let (delay, jitter) = (Duration::from_millis(100), Duration::from_millis(50));
    let pair = Pair::new(1, Weather { delay, jitter, ..Weather::default() });
    let mut sent = Vec::new();
    let mut delays_ms = Vec::new();
    let start = Instant::now();
    while delays_ms.len() < 400 {
        assert!(start.elapsed() < PATIENCE);
        if sent.len() < 400 {
            pair.send(u32::try_from(sent.len()).unwrap());
            sent.push(Instant::now());
        }
        // The next packet comes within some milliseconds.
        while let Some((number, _)) = Pair::receive(&pair.far, 3 * MILLISECOND) {
            assert_eq!(number as usize, delays_ms.len(), "out of order");
            delays_ms.push(sent[number as usize].elapsed().as_secs_f64() * 1e3);
        }
    }
    let mean = delays_ms.iter().sum::<f64>() / 400.0;
    let (least, most) = delays_ms.iter().fold((f64::MAX, 0.0_f64), |(a, b), &d| (a.min(d), b.max(d)));
    println!("{mean:.0} ms on average, {least:.0} to {most:.0}");
    // A busy machine only lengthens delays, but not all of them.
    assert!((49.0..90.0).contains(&least) && most > 110.0, "{least} {most}");
    assert!(mean >= 80.0, "{mean}");
}

#[test]
fn cuts_go_one_way_or_both_and_heal() {
    let pair = Pair::new(1, Weather::default());
    let [near, far] = [&pair.near, &pair.far].map(|socket| socket.local_addr().unwrap());
    let send = || pair.send(1);
    send();
    let (_, from) = Pair::receive(&pair.far, PATIENCE).unwrap();
    let answer = || pair.far.send_to(&[2, 0, 0, 0], from).unwrap();
    // Expected packets may take their time.
    let arrives = |socket: &UdpSocket, must: bool| {
        let limit = if must { PATIENCE } else { Duration::from_millis(100) };
        Pair::receive(socket, limit).is_some()
    };
    for (cut, there, back) in [
        ((Some(near), None), false, true),
        ((None, Some(near)), true, false),
        ((Some(far), Some(near)), true, false),
        ((None, None), false, false),
        ((Some(free_address()), None), true, true),
    ] {
        pair.proxy.cut(cut.0, cut.1);
        send();
        answer();
        assert_eq!((arrives(&pair.far, there), arrives(&pair.near, back)), (there, back), "{cut:?}");
        pair.proxy.heal();
        send();
        answer();
        assert!(arrives(&pair.far, true) && arrives(&pair.near, true), "{cut:?}");
    }
}

#[test]
fn what_is_on_its_way_when_it_is_cut_does_not_arrive() {
    // Long enough for the cut to come in time even on a busy machine.
    let delay = Duration::from_secs(2);
    let pair = Pair::new(1, Weather { delay, ..Weather::default() });
    pair.send(1);
    while pair.proxy.traffic().taken == 0 {
        std::thread::yield_now();
    }
    pair.proxy.cut(None, None);
    let sent = Instant::now();
    while pair.proxy.traffic().cut == 0 {
        assert!(sent.elapsed() < PATIENCE, "{:?}", pair.proxy.traffic());
        assert_eq!(Pair::receive(&pair.far, 10 * MILLISECOND), None);
    }
    assert_eq!(pair.proxy.traffic().passed, 0);
}

#[test]
fn a_free_port_is_none_that_the_system_gives_to_whoever_asks() {
    let [first, next] = [(); 2].map(|()| free_address());
    assert!(first != next && [first, next].iter().all(|address| address.port() < 32_768), "{first} {next}");
}

#[test]
fn a_dropped_proxy_gives_its_ports_back() {
    let pair = Pair::new(1, Weather { delay: PATIENCE, ..Weather::default() });
    pair.send(1);
    assert!(UdpSocket::bind(pair.front).is_err());
    let front = pair.front;
    drop(pair);
    UdpSocket::bind(front).unwrap();
}
