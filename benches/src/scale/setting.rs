//! Lists the settings by which a scene is computed: bare, by default, by numbers of regions, by fixed
//! methods.

use dcd::physics::Coupling;
use dcd::runtime::{Partitioning, WorldConfig};
use dcd::scene::Scene;

/// A setting, one row of every scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Setting {
    /// One Rapier world, with none of our code in its step.
    Bare,
    /// The same, on Rapier's own `parallel` with all threads.
    Parallel,
    /// The regions that dcd itself chooses for so many threads.
    Default,
    /// So many regions, with the default coupling.
    Auto(usize),
    /// Two regions with another coupling and one exchange per tick.
    Fixed(Coupling),
}

/// All settings, the bare world first: the others are compared with it.
pub(super) const SETTINGS: [Setting; 10] = [
    Setting::Bare,
    Setting::Parallel,
    Setting::Default,
    Setting::Auto(1),
    Setting::Auto(2),
    Setting::Auto(4),
    Setting::Auto(8),
    Setting::Auto(16),
    Setting::Fixed(Coupling::Owner),
    Setting::Fixed(Coupling::Overlap),
];

impl Setting {
    /// Returns the name in the rows, beside which the number of regions stands.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Bare => "bare",
            Self::Parallel => "parallel",
            Self::Default => "default",
            Self::Auto(_) => Coupling::Auto.name(),
            Self::Fixed(method) => method.name(),
        }
    }

    /// Returns the setting of a name and number of regions, as a worker is told them.
    pub(super) fn named(name: &str, regions: usize) -> Result<Self, String> {
        let is = |setting: &Self| setting.name() == name && setting.asked_regions() == Some(regions);
        let found = SETTINGS.into_iter().find(is);
        found.ok_or_else(|| format!("no setting `{name}` with {regions} regions"))
    }

    /// Returns the number of regions that are asked for; `None` where dcd chooses.
    pub(super) const fn asked_regions(self) -> Option<usize> {
        match self {
            Self::Bare | Self::Parallel => Some(0),
            Self::Default => None,
            Self::Auto(regions) => Some(regions),
            Self::Fixed(_) => Some(2),
        }
    }

    /// Returns the name with the number of regions, where some are asked for.
    pub(super) fn label(self) -> String {
        match self.asked_regions() {
            None | Some(0) => self.name().to_owned(),
            Some(regions) => format!("{} {regions}", self.name()),
        }
    }

    /// Returns the number of threads that it uses, of those that it may use.
    pub(super) fn threads(self, most: usize) -> usize {
        match self {
            Self::Parallel => most,
            _ => self.asked_regions().map_or(most, |regions| regions.clamp(1, most)),
        }
    }

    /// Returns the configuration; `None` for one Rapier world.
    pub(super) fn config(self, scene: &Scene, most_threads: usize) -> Option<WorldConfig> {
        let of = |partitioning| WorldConfig {
            partitioning,
            threads: self.threads(most_threads),
            ..WorldConfig::for_scene(scene)
        };
        match self {
            Self::Bare | Self::Parallel => None,
            Self::Default => Some(of(Partitioning::Auto)),
            Self::Auto(regions) => Some(of(Partitioning::Regions(regions))),
            Self::Fixed(method) => {
                let mut config = of(Partitioning::Regions(2));
                config.step = config.step.with_coupling(method);
                config.step.exchanges = 1;
                Some(config)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use dcd::scene::Params;

    use super::*;

    #[test]
    fn a_setting_is_found_by_its_name_and_regions() {
        for setting in SETTINGS.into_iter().filter(|setting| *setting != Setting::Default) {
            let regions = setting.asked_regions().unwrap();
            assert_eq!(Setting::named(setting.name(), regions), Ok(setting));
        }
        assert!(Setting::named("owner", 4).is_err());
    }

    #[test]
    fn settings_are_cut_and_coupled_as_their_names_say() {
        let scene = Scene::named("tower", &Params::new()).unwrap();
        for setting in SETTINGS {
            let Some(config) = setting.config(&scene, 2) else {
                assert!(matches!(setting, Setting::Bare | Setting::Parallel));
                assert_eq!(setting.threads(2), if setting == Setting::Bare { 1 } else { 2 });
                continue;
            };
            config.check().unwrap();
            let leaves = config.tree().unwrap().leaf_count();
            assert!(setting.asked_regions().is_none_or(|asked| asked == leaves), "{setting:?}");
            match setting {
                Setting::Fixed(method) => {
                    assert_eq!((config.step.coupling, config.step.exchanges), (method, 1))
                }
                _ => assert_eq!(config.step.coupling, Coupling::Auto),
            }
            assert_eq!(
                config.threads,
                if matches!(setting, Setting::Auto(1)) { 1 } else { 2 },
                "{setting:?}"
            );
        }
    }
}
