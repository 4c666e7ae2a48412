//! What of the elements has changed.

use crate::solver::state::Version;

/// Elements of the same version are the same, in some respect.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Versions {
    /// In all.
    pub all: Version,
    /// In their ends and coefficients.
    pub rates: Version,
    /// In their ends, and whether they act.
    pub ends: Version,
    /// In the ends of those that have a strain limit.
    pub limits: Version,
    /// In what they bear.
    pub failures: Version,
    /// What has changed since this version is listed.
    pub edited_since: Version,
}

impl Versions {
    /// Everything may be other than before.
    pub fn reset(&mut self) {
        let new = Version::new();
        *self = Self { all: new, rates: new, ends: new, limits: new, failures: new, edited_since: new };
    }
}
