//! Parses the parameters of scenes, given as `name=value`. Tables describe them, so that help texts and
//! errors cannot go stale.

use std::collections::BTreeMap;
use std::fmt;

use super::SceneError;
use super::error::nearest;

/// The parameters of a scene as the user gives them: names and values as text, in order of name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Params(BTreeMap<String, String>);

/// The range of a parameter; both ends belong to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamKind {
    /// A whole number.
    Count(u64, u64),
    /// A finite decimal number.
    Number(f64, f64),
}

/// The description of one parameter of a scene, for help texts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParamInfo {
    /// The name by which it is given.
    pub name: &'static str,
    /// The value when it is not given, as text.
    pub default: &'static str,
    /// Accepted values.
    pub kind: ParamKind,
    /// Unit of the value; empty for plain numbers.
    pub unit: &'static str,
    /// Its effect.
    pub what: &'static str,
}

/// Describes a parameter that is a whole number.
pub(super) const fn count(
    name: &'static str,
    default: &'static str,
    least: u64,
    most: u64,
    what: &'static str,
) -> ParamInfo {
    ParamInfo { name, default, kind: ParamKind::Count(least, most), unit: "", what }
}

/// Describes a parameter that is a decimal number.
pub(super) const fn number(
    name: &'static str,
    default: &'static str,
    [least, most]: [f64; 2],
    unit: &'static str,
    what: &'static str,
) -> ParamInfo {
    ParamInfo { name, default, kind: ParamKind::Number(least, most), unit, what }
}

impl Params {
    /// Returns an empty set of parameters: the scene's defaults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Parses arguments of a command line, each `name=value`; a later one wins. Returns an error for an
    /// argument without `=` or without a name.
    pub fn from_args(args: impl IntoIterator<Item = impl AsRef<str>>) -> Result<Self, SceneError> {
        let mut params = Self::new();
        for arg in args {
            let arg = arg.as_ref();
            match arg.split_once('=') {
                Some((name, value)) if !name.trim().is_empty() => params.set(name.trim(), value.trim()),
                _ => return Err(SceneError::NotKeyValue(arg.to_owned())),
            };
        }
        Ok(params)
    }

    /// Returns these parameters with one added or changed.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl fmt::Display) -> Self {
        self.set(name, value);
        self
    }

    /// Sets the value of one parameter.
    pub fn set(&mut self, name: &str, value: impl fmt::Display) -> &mut Self {
        self.0.insert(name.to_owned(), value.to_string());
        self
    }

    /// Returns whether no parameter is given.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns names and values, in order of name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(name, value)| (name.as_str(), value.as_str()))
    }

    fn value(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }
}

impl fmt::Display for ParamInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, default, kind, unit, what } = self;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        write!(f, "{name}={default}{unit} ({kind}): {what}")
    }
}

impl fmt::Display for ParamKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(least, u64::MAX) => write!(f, "a whole number from {least}"),
            Self::Count(least, most) => write!(f, "a whole number from {least} to {most}"),
            Self::Number(least, most) => write!(f, "a number from {least} to {most}"),
        }
    }
}

/// The values of one scene's parameters, each within its range.
pub(crate) struct Values {
    scene: &'static str,
    infos: &'static [ParamInfo],
    given: Params,
    values: BTreeMap<&'static str, Value>,
}

#[derive(Clone, Copy)]
enum Value {
    Count(u64),
    Number(f64),
}

impl Values {
    /// Checks the parameters that the user gave against the scene's table, and adds the defaults.
    pub(crate) fn parse(
        scene: &'static str,
        infos: &'static [ParamInfo],
        params: &Params,
    ) -> Result<Self, SceneError> {
        if let Some((name, _)) = params.iter().find(|(name, _)| infos.iter().all(|info| info.name != *name)) {
            return Err(SceneError::UnknownParam {
                scene: scene.to_owned(),
                name: name.to_owned(),
                nearest: nearest(name, infos.iter().map(|info| info.name)),
                known: table(infos),
            });
        }
        let mut checked = Self { scene, infos, given: params.clone(), values: BTreeMap::new() };
        for info in infos {
            let text = params.value(info.name).unwrap_or(info.default);
            match parse(info.kind, text) {
                Some(value) => checked.values.insert(info.name, value),
                None => return Err(checked.refuse(info.name, &info.kind.to_string())),
            };
        }
        Ok(checked)
    }

    /// Returns the value of a parameter that is a whole number.
    pub(crate) fn count(&self, name: &str) -> usize {
        self.seed(name) as usize
    }

    /// Returns the value of a parameter that is a whole number, in 64 bits.
    pub(crate) fn seed(&self, name: &str) -> u64 {
        match self.values[name] {
            Value::Count(value) => value,
            Value::Number(_) => panic!("parameter `{name}` of `{}` is not a count", self.scene),
        }
    }

    /// Returns the value of a parameter that is a decimal number.
    pub(crate) fn number(&self, name: &str) -> f32 {
        match self.values[name] {
            Value::Number(value) => value as f32,
            Value::Count(_) => panic!("parameter `{name}` of `{}` is not a number", self.scene),
        }
    }

    /// Returns the error for a value that only the scene itself can judge.
    pub(crate) fn refuse(&self, name: &str, expected: &str) -> SceneError {
        let default = self.infos.iter().find(|info| info.name == name).map_or("", |info| info.default);
        SceneError::BadParam {
            scene: self.scene.to_owned(),
            name: name.to_owned(),
            value: self.given.value(name).unwrap_or(default).to_owned(),
            expected: expected.to_owned(),
            known: table(self.infos),
        }
    }
}

fn table(infos: &[ParamInfo]) -> String {
    infos.iter().map(|info| format!("  {info}")).collect::<Vec<_>>().join("\n")
}

fn parse(kind: ParamKind, text: &str) -> Option<Value> {
    match kind {
        // 20_000 reads better than 20000.
        ParamKind::Count(least, most) => {
            let value = text.replace('_', "").parse().ok()?;
            (least..=most).contains(&value).then_some(Value::Count(value))
        }
        ParamKind::Number(least, most) => {
            let value = text.parse().ok()?;
            (least..=most).contains(&value).then_some(Value::Number(value))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INFOS: &[ParamInfo] = &[
        ParamInfo { name: "n", default: "10", kind: ParamKind::Count(1, 99), unit: "", what: "bodies" },
        ParamInfo { name: "gap", default: "0.5", kind: ParamKind::Number(0.0, 9.0), unit: "m", what: "gap" },
    ];

    #[test]
    fn values_are_defaults_unless_given() {
        let values = Values::parse("x", INFOS, &Params::new().with("gap", 2)).unwrap();
        assert_eq!((values.count("n"), values.number("gap")), (10, 2.0));
    }

    #[test]
    fn an_unknown_parameter_names_the_known_ones() {
        let error = Values::parse("x", INFOS, &Params::new().with("gab", 2)).err().unwrap().to_string();
        assert!(error.contains("did you mean `gap`"), "{error}");
        assert!(error.contains("n=10 (a whole number from 1 to 99): bodies"), "{error}");
    }

    #[test]
    fn a_value_out_of_range_or_not_a_number_is_refused() {
        for (name, value) in
            [("n", "0"), ("n", "ten"), ("n", "1.5"), ("gap", "nan"), ("gap", "inf"), ("gap", "-1")]
        {
            let error =
                Values::parse("x", INFOS, &Params::new().with(name, value)).err().unwrap().to_string();
            assert!(error.contains(&format!("`{name}={value}` is not a")), "{error}");
        }
    }

    #[test]
    fn arguments_are_split_at_the_first_equals_sign() {
        let params = Params::from_args(["n=20", "gap = 1"]).unwrap();
        assert_eq!(params.iter().collect::<Vec<_>>(), [("gap", "1"), ("n", "20")]);
        assert!(Params::from_args(["n"]).unwrap_err().to_string().contains("write `name=value`"));
    }
}
