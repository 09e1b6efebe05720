//! Tests that the game drawn by raylib is built from packages, plays in a served world, and shows it, on a
//! virtual screen.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use dcd::net::JoinRole;
use dcd::runtime::WorldConfig;
use dcd::scene::{Params, Scene};

use crate::packaging::cmake_build;
use crate::served::Cluster;
use crate::toolchain::{is_installed, root, run_well, target_dir};

/// An X server that draws into memory.
struct Screen {
    server: Child,
    display: String,
}

impl Screen {
    /// Opens a screen. The server chooses its number.
    fn open() -> Self {
        let mut xvfb = Command::new("Xvfb");
        xvfb.args(["-displayfd", "1", "-screen", "0", "1280x720x24", "-nolisten", "tcp"]);
        let mut server = xvfb.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("Xvfb starts");
        let mut display = String::new();
        BufReader::new(server.stdout.take().expect("it is piped")).read_line(&mut display).unwrap();
        assert!(!display.is_empty(), "Xvfb finds no free display");
        Self { server, display: format!(":{}", display.trim()) }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Returns what is missing to build raylib and to run a virtual screen.
fn missing() -> Option<&'static str> {
    let headers = ["--exists", "x11", "xrandr", "xinerama", "xcursor", "xi", "gl"];
    if !is_installed("cmake") {
        return Some("cmake");
    }
    // Xvfb has no --version.
    if Command::new("sh")
        .args(["-c", "command -v Xvfb"])
        .output()
        .map_or(true, |found| !found.status.success())
    {
        return Some("Xvfb");
    }
    let found = Command::new("pkg-config").args(headers).status();
    (!found.is_ok_and(|status| status.success())).then_some("pkg-config, or a header of X11 or GL,")
}

/// Returns a picture's pixels and its width.
fn pixels(path: &Path) -> (Vec<[i32; 3]>, usize) {
    let file = std::fs::File::open(path).unwrap();
    let mut picture = png::Decoder::new(BufReader::new(file)).read_info().expect("a PNG file");
    let mut bytes = vec![0; picture.output_buffer_size().expect("it fits")];
    let shape = picture.next_frame(&mut bytes).expect("its whole picture");
    assert_eq!(shape.color_type, png::ColorType::Rgb);
    (
        bytes.chunks(3).map(|pixel| [0, 1, 2].map(|part| i32::from(pixel[part]))).collect(),
        shape.width as usize,
    )
}

#[test]
fn raylib_draws_a_served_world_with_the_avatar_of_its_player() {
    if let Some(tool) = missing() {
        eprintln!("{tool} is not installed: nothing checked");
        return;
    }
    let build = target_dir().join("raylib");
    cmake_build("examples-c/raylib", &build, &[]);

    let scene = Scene::open(root().join("examples-c/raylib/yard.toml").to_str().unwrap(), &Params::default())
        .unwrap();
    let cluster = Cluster::of(&scene, &WorldConfig::for_scene(&scene), 2);
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("picture.png");
    let screen = Screen::open();
    let mut play = Command::new(build.join("play"));
    play.arg(cluster.server.address.to_string())
        .arg(cluster.token(JoinRole::Client))
        .env("DISPLAY", &screen.display);
    let said = run_well(play.arg("--screenshot").arg(&picture).args(["--frames", "120"]));
    cluster.stop();

    let last = said.lines().last().expect("it says something");
    let value = |name: &str| -> f64 {
        let rest = last.split(&format!(" {name}=")).nth(1).unwrap_or_else(|| panic!("{said}"));
        rest.split(' ').next().and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{said}"))
    };
    assert_eq!(value("frames"), 120.0, "{said}");
    assert_eq!(value("bodies"), 178.0, "those of the scene, and the avatar: {said}");
    assert_eq!(value("meshes"), 8.0, "five that are stretched; terrain, a ramp and a hull: {said}");
    assert!(value("moved_m") > 3.0, "it walks towards the wall: {said}");
    assert!(value("behind_ms") > 0.0 && value("ahead_ms") > 0.0, "others behind, the avatar ahead: {said}");

    let (pixels, width) = pixels(&picture);
    let count = |is: fn([i32; 3]) -> bool| pixels.iter().filter(|&&pixel| is(pixel)).count();
    let yellow = count(|[r, g, b]| r > b + 50 && g > b + 30);
    let purple = count(|[r, g, b]| r > g + 20 && b > r + 20);
    let cyan = count(|[r, g, b]| g > r + 25 && b > r + 25 && (g - b).abs() < 25);
    let pink = count(|[r, g, b]| r > g + 35 && r > b + 15);
    let sky = count(|colour| colour == [158, 189, 219]);
    for region in [yellow, purple, cyan, pink] {
        assert!(region > 1000, "each of four regions shows: {yellow} {purple} {cyan} {pink}");
    }
    assert!(sky > 50_000 && sky < pixels.len() / 2, "there is sky above, and a world below: {sky}");
    let middle =
        pixels.chunks(width).skip(340).take(120).flat_map(|row| &row[width / 2 - 25..width / 2 + 25]);
    let avatar = middle.filter(|[r, g, b]| r.min(g).min(b) > &200 && r - b < 25).count();
    assert!(avatar > 800, "its white capsule stands in the middle: {avatar}");
}
