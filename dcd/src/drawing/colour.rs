//! Chooses the colours of regions, as the viewer's page has them, and of bodies.

use super::source::Seen;

/// The colours of regions by their indices in id order, as red, green and blue. `view/page/main.js` has the
/// same.
const REGIONS: [[u8; 3]; 12] = [
    [0x42, 0x69, 0xd0],
    [0xef, 0xb1, 0x18],
    [0x3c, 0xa9, 0x51],
    [0xff, 0x72, 0x5c],
    [0xa4, 0x63, 0xf2],
    [0x38, 0xb2, 0xc4],
    [0xff, 0x8a, 0xb7],
    [0x9c, 0x6b, 0x4e],
    [0x7f, 0x8b, 0xa0],
    [0xb8, 0xc1, 0x3a],
    [0x5f, 0xa8, 0xe8],
    [0xd8, 0x76, 0x3a],
];
/// The colour of fixed bodies. The colours of sleeping bodies are mixed with it.
const GREY: [u8; 3] = [0x9a, 0xa0, 0xa8];
/// The opacity of sensors, and of bodies outside the area of interest.
const FAINT: u8 = 0x60;

/// Returns the colour of the region at an index in id order.
pub(crate) fn of_region(place: u16) -> [u8; 4] {
    opaque(REGIONS[usize::from(place) % REGIONS.len()])
}

/// Returns the colour of a movable body: its owner's, greyed while it sleeps, faint if it is outside the area
/// of interest.
pub(crate) fn of_body(seen: &Seen) -> [u8; 4] {
    let [red, green, blue, _] = of_region(seen.owner);
    let own = [red, green, blue];
    let mixed = std::array::from_fn(|i| (u16::from(own[i]) + u16::from(GREY[i])).div_euclid(2) as u8);
    let colour = opaque(if seen.sleeping { mixed } else { own });
    if seen.outside { faint(colour) } else { colour }
}

/// Returns the colour of fixed bodies.
pub(crate) fn of_fixed() -> [u8; 4] {
    opaque(GREY)
}

/// Returns a colour with the opacity [`FAINT`].
pub(crate) fn faint([red, green, blue, _]: [u8; 4]) -> [u8; 4] {
    [red, green, blue, FAINT]
}

fn opaque([red, green, blue]: [u8; 3]) -> [u8; 4] {
    [red, green, blue, 0xff]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_the_same_colours() {
        let page = include_str!("../view/page/main.js");
        let named =
            REGIONS.map(|[red, green, blue]| format!("\"{red:02x}{green:02x}{blue:02x}\"")).join(", ");
        assert!(page.contains(&format!("const PALETTE = [{named}];")), "{named}");
    }
}
