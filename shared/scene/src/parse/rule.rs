//! Object visibility rules.

use super::Fault;
use super::words::RayType;
use crate::values::*;
use schemars::JsonSchema;
use serde::Deserialize;

/// Names of shapes, lights and groups.
pub type Names = Spanned<Vec<Spanned<String>>>;

/// What rays of some types do not see if they start at some things.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RuleRecord {
    /// Names of shapes, lights and groups where the rays start; also "camera", "world" (its medium), "all". Default:
    /// all.
    pub on: Option<Names>,
    /// Names excluded from `on`.
    pub except: Option<Names>,
    /// Ray types.
    pub rays: Spanned<Vec<Spanned<RayType>>>,
    /// Names of things that the rays pass through, and of lights whose light they do not see; or "all".
    pub exclude: Option<Names>,
    /// Instead of `exclude`: the names of the only objects, or the only lights, that are seen.
    pub include: Option<Names>,
}

impl RuleRecord {
    pub fn check(&self) -> Result<(), Fault> {
        if self.rays.get_ref().is_empty() {
            return Err(Fault::new(self.rays.span(), "expected a type of ray"));
        }
        match (&self.exclude, &self.include) {
            (Some(_), None) => Ok(()),
            (None, Some(names)) if names.get_ref().is_empty() => Err(Fault::new(
                names.span(),
                "expected a name; to hide everything, write exclude = [\"all\"]",
            )),
            (None, Some(_)) => Ok(()),
            (Some(_), Some(names)) => Err(Fault::new(
                names.span(),
                "a rule has `exclude` or `include`; write two rules",
            )),
            (None, None) => Err(Fault::new(
                self.rays.span(),
                "a rule has a list `exclude` or a list `include`",
            )),
        }
    }
}
