//! What of the elements has changed.

use super::Elements;
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

impl Elements {
    /// Changes whenever an element does.
    pub(in crate::solver) fn version(&self) -> Version {
        self.versions.all
    }

    /// Changes whenever ends or coefficients do.
    pub(in crate::solver) fn rates_version(&self) -> Version {
        self.versions.rates
    }

    /// Changes when elements get other ends, begin or cease to act.
    pub(in crate::solver) fn ends_version(&self) -> Version {
        self.versions.ends
    }

    /// Changes when elements with a strain limit are added or removed.
    pub(in crate::solver) fn limits_version(&self) -> Version {
        self.versions.limits
    }

    /// Whether the tables list what has changed since `version`, apart from added elements.
    pub(in crate::solver) fn lists_edits_since(&self, version: Version) -> bool {
        self.versions.edited_since == version
    }
}
