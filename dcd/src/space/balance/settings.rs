//! Defines the settings of load balancing, and checks them.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use crate::space::region_set::MAX_REGIONS;

/// The settings by which the regions of a world follow its load: planes move, regions are split and merged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Encode, Decode)]
#[serde(default, deny_unknown_fields)]
pub struct Balance {
    /// The number of ticks between two looks at the load; at least 1.
    pub every_ticks: u32,
    /// The factor above the mean load at which planes move, compared with the heaviest region's load; above
    /// 1.
    pub tolerance: f64,
    /// The load above which the heaviest region is cut: bodies and contacts, or microseconds per tick.
    pub split_above: f64,
    /// The load below which two sibling regions together are merged; less than `split_above`.
    pub merge_below: f64,
    /// The least number of regions, at least 1.
    pub least_regions: usize,
    /// The largest number of regions, at most [`MAX_REGIONS`] (256).
    pub most_regions: usize,
    /// The smallest edge of a region, metres, above 0: a few times the largest common body.
    pub smallest_edge_m: f64,
    /// The measure of load.
    pub load: Load,
}

/// The measure of load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Encode, Decode)]
#[serde(rename_all = "lowercase")]
pub enum Load {
    /// The number of awake bodies, ghosts included, and contacts: the same on every machine.
    #[default]
    Counts,
    /// The time that regions took, in microseconds per tick, smoothed: the true load, and never the same
    /// twice.
    Times,
}

impl Default for Balance {
    fn default() -> Self {
        Self {
            every_ticks: 30,
            tolerance: 1.2,
            split_above: 20_000.0,
            merge_below: 1_000.0,
            least_regions: 1,
            most_regions: 64,
            smallest_edge_m: 4.0,
            load: Load::Counts,
        }
    }
}

impl Balance {
    /// Returns settings that keep this number of regions, whatever the load.
    #[must_use]
    pub fn keeping(regions: usize) -> Self {
        Self { least_regions: regions, most_regions: regions, ..Self::default() }
    }

    /// Returns settings that give each node of a served world one region, in proportion to the node's speed,
    /// as nodes come and go.
    #[must_use]
    pub fn by_nodes() -> Self {
        Self { split_above: 1e9, merge_below: 0.5e9, load: Load::Times, ..Self::default() }
    }

    /// Returns the same settings for so many nodes, none of which is to be without a region.
    #[doc(hidden)]
    pub fn among(self, nodes: usize) -> Self {
        Self { least_regions: self.least_regions.max(nodes).min(self.most_regions), ..self }
    }

    /// Returns what is wrong with the settings, if anything: the name of the setting, its value, and the
    /// values that are allowed.
    #[doc(hidden)]
    pub fn fault(&self) -> Option<(&'static str, String, &'static str)> {
        let Self { every_ticks, tolerance, split_above, merge_below, least_regions, most_regions, .. } =
            *self;
        let edge = self.smallest_edge_m;
        let found = |what, value: &dyn ToString, range| Some((what, value.to_string(), range));
        if every_ticks == 0 {
            found("every_ticks", &every_ticks, "1 tick or more")
        } else if tolerance.is_nan() || tolerance <= 1.0 {
            found("tolerance", &tolerance, "a number above 1, as 1.2")
        } else if split_above.is_nan() {
            found("split_above", &split_above, "a number, in units of the load")
        } else if merge_below.is_nan() || merge_below >= split_above {
            found("merge_below", &merge_below, "less than split_above, or regions flap")
        } else if least_regions == 0 {
            found("least_regions", &least_regions, "1 region or more")
        } else if most_regions < least_regions || most_regions > MAX_REGIONS {
            found("most_regions", &most_regions, "from least_regions to 256")
        } else if !(edge > 0.0 && edge.is_finite()) {
            found("smallest_edge_m", &edge, "a positive number of metres")
        } else {
            None
        }
    }
}
