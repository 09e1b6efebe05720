//! Holds the coupling settings that a scene, a command line or a program asks for, and applies them to [`StepSettings`].

use super::{Coupling, Preset, StepSettings};

/// A coupling method with the settings that suit it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// This method, with its usual exchanges per tick.
    Coupling(Coupling),
    /// [`Coupling::Auto`] with all that the preset stands for.
    Preset(Preset),
}

/// The coupling settings that are asked for; `None` leaves a setting as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CouplingChoice {
    /// The coupling method. It is applied before the settings below.
    pub method: Option<Method>,
    /// As [`StepSettings::exchanges`].
    pub exchanges: Option<usize>,
    /// As [`StepSettings::depth`].
    pub depth: Option<usize>,
    /// As [`StepSettings::island_limit`].
    pub island_limit: Option<usize>,
    /// As [`StepSettings::tolerance_m_s`].
    pub tolerance_m_s: Option<f32>,
}

impl CouplingChoice {
    /// Returns the settings changed as asked.
    ///
    /// ```
    /// use dcd::physics::{CouplingChoice, Method, Preset, StepSettings};
    ///
    /// let choice = CouplingChoice {
    ///     method: Some(Method::Preset(Preset::Draft)),
    ///     depth: Some(3),
    ///     ..CouplingChoice::default()
    /// };
    /// let step = choice.applied_to(StepSettings::default());
    /// assert_eq!((step.depth, step.island_limit), (3, 256));
    /// ```
    pub fn applied_to(self, step: StepSettings) -> StepSettings {
        let step = match self.method {
            None => step,
            Some(Method::Coupling(coupling)) => step.with_coupling(coupling),
            Some(Method::Preset(preset)) => step.with_preset(preset),
        };
        StepSettings {
            exchanges: self.exchanges.unwrap_or(step.exchanges),
            depth: self.depth.unwrap_or(step.depth),
            island_limit: self.island_limit.unwrap_or(step.island_limit),
            tolerance_m_s: self.tolerance_m_s.unwrap_or(step.tolerance_m_s),
            ..step
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_asked_for_stays() {
        let step = StepSettings { depth: 7, ..StepSettings::default() };
        assert_eq!(CouplingChoice::default().applied_to(step), step);
        let choice = CouplingChoice { exchanges: Some(3), ..CouplingChoice::default() };
        assert_eq!(choice.applied_to(step), StepSettings { exchanges: 3, ..step });
    }

    #[test]
    fn a_method_brings_its_numbers_and_numbers_asked_for_stand() {
        let owner = Method::Coupling(Coupling::Owner);
        let choice = |method| CouplingChoice {
            method: Some(method),
            tolerance_m_s: Some(0.5),
            ..CouplingChoice::default()
        };
        let step = choice(owner).applied_to(StepSettings::default());
        assert_eq!((step.coupling, step.exchanges, step.tolerance_m_s), (Coupling::Owner, 1, 0.5));
        let step = choice(Method::Preset(Preset::Precise)).applied_to(step);
        assert_eq!((step.coupling, step.depth, step.island_limit), (Coupling::Auto, 3, 65_534));
        assert_eq!(step.tolerance_m_s, 0.5);
    }
}
