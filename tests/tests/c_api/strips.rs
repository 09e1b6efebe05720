//! Tests the pictures that a C program draws of what its player sees, at a delay of 100 ms each way.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;
use std::process::Command;

use dcd::network::JoinRole;
use dcd::prelude::*;
use dcd_tests::stage::{PATIENCE, Stage, ms};

use crate::programs::{SANITIZED, numbers};
use crate::toolchain::{build, root, run, run_well};

/// The number of pictures of a strip, and the side of a picture, pixels.
const PICTURES: usize = 10;
const SIDE: usize = 120;
/// The number of rows from the top to the ground.
const GROUND: usize = 104;
/// The avatar's colour in the palette.
const AVATAR: u8 = 3;

/// Returns the pixels of a strip, as numbers of its palette.
fn strip(file: &Path) -> Vec<u8> {
    let file = std::fs::File::open(file).unwrap();
    let mut picture = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG file");
    let info = picture.info();
    assert_eq!((info.width as usize, info.height as usize), (PICTURES * SIDE, SIDE));
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Indexed, png::BitDepth::Two));
    let mut bytes = vec![0; PICTURES * SIDE * SIDE / 4];
    picture.next_frame(&mut bytes).expect("its whole picture");
    bytes.iter().flat_map(|byte| [byte >> 6, byte >> 4 & 3, byte >> 2 & 3, byte & 3]).collect()
}

/// Returns the columns of a picture that have the avatar's colour in one of these rows.
fn avatar(strip: &[u8], picture: usize, rows: Range<usize>) -> BTreeSet<usize> {
    let is_there =
        |column: &usize| rows.clone().any(|row| strip[(row * PICTURES + picture) * SIDE + column] == AVATAR);
    (0..SIDE).filter(is_there).collect()
}

#[test]
fn strips_show_an_avatar_that_answers_at_once_and_told_states_that_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Scene::named("tower", &Params::new().with("n", 3)).unwrap();
    let world = World::from_scene(&scene, WorldConfig::for_scene(&scene)).unwrap();
    let stage = Stage::of(world, ms(100, 0, 0.0));
    let mut strips = Command::new(build(&root().join("examples-c/strips.c"), folder.path(), &SANITIZED));
    strips.arg(stage.server.address().unwrap().to_string());
    strips.arg(stage.server.token(JoinRole::Client, PATIENCE).unwrap());
    let said = run_well(strips.arg(folder.path()));
    let last = said.lines().last().expect("it says something");
    let [told_frames, shown_frames] = numbers(last)[..] else { panic!("{said}") };
    assert!(shown_frames <= 2.0 && told_frames > 8.0, "{said}");

    let names = ["told.png", "shown.png"];
    if std::env::var_os("UPDATE").is_some() {
        for name in names {
            std::fs::copy(folder.path().join(name), root().join("dcd/manual").join(name)).unwrap();
        }
    }
    let [told, shown] = names.map(|name| strip(&folder.path().join(name)));
    let left = |strip: &[u8], picture| *avatar(strip, picture, 0..GROUND).first().expect("it is there");
    assert_eq!(left(&told, 1), left(&told, 0), "at first it stands");
    for picture in 1..PICTURES {
        assert!(left(&shown, picture) >= left(&shown, picture - 1), "picture {picture}");
        assert!(picture < 3 || left(&told, picture) + 16 < left(&shown, picture), "picture {picture}");
    }
    let way = left(&shown, PICTURES - 1) - left(&shown, 0);
    assert!((60..90).contains(&way), "it goes 72 pixels: {way}");
    // The lines below the ground: one per frame, or one per batch of states.
    let lines = [&told, &shown].map(|strip| avatar(strip, PICTURES - 1, GROUND + 8..GROUND + 9).len());
    assert!(lines[0] > 1 && 3 * lines[0] < lines[1], "{lines:?}");
}

#[test]
fn a_folder_that_strips_cannot_write_to_is_said_before_it_joins() {
    let folder = tempfile::tempdir().unwrap();
    let mut strips = Command::new(build(&root().join("examples-c/strips.c"), folder.path(), &[]));
    let ended = run(strips.args(["127.0.0.1:9", "no token"]).arg(folder.path().join("nowhere")));
    assert_eq!(ended.status.code(), Some(1));
    assert!(ended.stderr.contains("nowhere/told.png: No such file"), "{}", ended.stderr);
}
