//! Lists the figures of the thesis, chapter 5: milliseconds of a simulation step, measured in 2006 on a
//! cluster of 2.8 GHz Pentium 4 PCs.

/// One row of tables 5.1 and 5.7, or one column of table 5.2: a world of so many objects.
pub(super) struct Published {
    pub(super) objects: usize,
    /// The milliseconds and the collisions of a step on one node (table 5.1).
    pub(super) alone: (f64, f64),
    /// Means of the members of groups of 2 to 8 (table 5.2); `None` above 4,000 objects.
    pub(super) groups: Option<[f64; 7]>,
    /// Means of the members of groups of 16 and 32 (table 5.7).
    pub(super) large: Option<[f64; 2]>,
}

const fn of(
    objects: usize,
    alone: (f64, f64),
    groups: Option<[f64; 7]>,
    large: Option<[f64; 2]>,
) -> Published {
    Published { objects, alone, groups, large }
}

pub(super) const WORLDS: [Published; 10] = [
    of(500, (180.0, 9.0), Some([78.0, 50.0, 36.0, 37.0, 32.0, 26.0, 18.0]), None),
    of(1_000, (360.0, 16.0), Some([123.0, 98.0, 83.0, 71.0, 67.0, 50.0, 49.0]), Some([21.0, 27.0])),
    of(1_500, (447.0, 23.0), Some([170.0, 124.0, 79.0, 67.0, 65.0, 60.0, 62.0]), None),
    of(2_000, (604.0, 30.0), Some([264.0, 152.0, 149.0, 133.0, 112.0, 81.0, 77.0]), Some([38.0, 26.0])),
    of(2_500, (659.0, 45.0), Some([385.0, 189.0, 140.0, 132.0, 104.0, 83.0, 84.0]), None),
    of(3_000, (825.0, 56.0), Some([520.0, 230.0, 185.0, 155.0, 137.0, 104.0, 92.0]), Some([65.0, 38.0])),
    of(3_500, (984.0, 62.0), Some([468.0, 238.0, 223.0, 197.0, 193.0, 175.0, 105.0]), None),
    of(4_000, (1_128.0, 72.0), Some([582.0, 392.0, 335.0, 301.0, 264.0, 157.0, 135.0]), None),
    of(4_500, (1_187.0, 78.0), None, None),
    of(5_000, (1_228.0, 86.0), None, None),
];

/// How much longer the leader's step took than the members', percent of the leader's, in groups of 2 to 8
/// (table 5.6).
pub(super) const LEADER_PERCENT: [f64; 7] = [10.0, 42.0, 19.0, 24.0, 31.0, 46.0, 20.0];

/// Mean scale-up of groups of 2 to 8 (table 5.3).
pub(super) const SCALE_UP: [f64; 7] = [2.19, 3.62, 4.50, 5.03, 5.62, 7.21, 8.37];

impl Published {
    /// Returns the world of so many objects, if the thesis had it.
    pub(super) fn world(objects: usize) -> Option<&'static Self> {
        WORLDS.iter().find(|world| world.objects == objects)
    }

    /// Returns the milliseconds of a step of a group of so many nodes, if the thesis had it.
    pub(super) fn step_ms(&self, nodes: usize) -> Option<f64> {
        match nodes {
            1 => Some(self.alone.0),
            2..=8 => Some(self.groups?[nodes - 2]),
            16 => Some(self.large?[0]),
            32 => Some(self.large?[1]),
            _ => None,
        }
    }
}
