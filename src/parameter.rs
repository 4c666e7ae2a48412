//! The rules that physical parameters obey, and the error that says which one was broken.
//!
//! Components, resources and scene files all check themselves through these few functions, so that
//! a negative mass is described in the same words wherever it comes from.

use bevy::math::Vec3;

/// A parameter outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} is {value}, expected {expected}")]
#[non_exhaustive]
pub struct InvalidParameter {
    /// The name of the field, as it stands in the component or scene file.
    pub field: &'static str,
    /// The value that was refused, printed.
    pub value: String,
    /// What would have been accepted.
    pub expected: &'static str,
}

#[inline]
fn require(
    accepted: bool,
    field: &'static str,
    value: impl std::fmt::Debug,
    expected: &'static str,
) -> Result<(), InvalidParameter> {
    if accepted { Ok(()) } else { Err(refused(field, value, expected)) }
}

#[cold]
fn refused(field: &'static str, value: impl std::fmt::Debug, expected: &'static str) -> InvalidParameter {
    InvalidParameter { field, value: format!("{value:?}"), expected }
}

/// Accepts finite numbers > 0.
///
/// # Errors
/// [`InvalidParameter`] naming `field` otherwise.
#[inline]
pub fn positive(field: &'static str, value: f32) -> Result<(), InvalidParameter> {
    require(value.is_finite() && value > 0.0, field, value, "a finite number > 0")
}

/// Accepts finite numbers > 0 with a finite inverse.
///
/// # Errors
/// [`InvalidParameter`] naming `field` otherwise.
#[inline]
pub fn mass(field: &'static str, value: f32) -> Result<(), InvalidParameter> {
    positive(field, value)?;
    require((1.0 / value).is_finite(), field, value, "a number of which the inverse is finite")
}

/// Accepts finite numbers >= 0.
///
/// # Errors
/// [`InvalidParameter`] naming `field` otherwise.
#[inline]
pub fn non_negative(field: &'static str, value: f32) -> Result<(), InvalidParameter> {
    require(value.is_finite() && value >= 0.0, field, value, "a finite number >= 0")
}

/// Accepts numbers from 0 to 1, both included.
///
/// # Errors
/// [`InvalidParameter`] naming `field` otherwise.
pub fn fraction(field: &'static str, value: f32) -> Result<(), InvalidParameter> {
    require((0.0..=1.0).contains(&value), field, value, "a number from 0 to 1")
}

/// Accepts vectors of three finite components.
///
/// # Errors
/// [`InvalidParameter`] naming `field` otherwise.
pub fn finite(field: &'static str, value: Vec3) -> Result<(), InvalidParameter> {
    require(value.is_finite(), field, value.to_array(), "a vector of finite numbers")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_names_field_value_and_range() {
        let error = positive("mass", -1.0).unwrap_err();
        assert_eq!(error.to_string(), "mass is -1.0, expected a finite number > 0");
    }

    #[test]
    fn the_ends_of_each_range() {
        assert!(positive("mass", f32::MIN_POSITIVE).is_ok());
        assert!(positive("mass", 0.0).is_err());
        assert!(mass("mass", f32::MIN_POSITIVE).is_ok() && mass("mass", 1e-40).is_err());
        assert!(positive("mass", f32::INFINITY).is_err());
        assert!(non_negative("radius", 0.0).is_ok());
        assert!(non_negative("radius", -f32::MIN_POSITIVE).is_err());
        assert!(non_negative("radius", f32::NAN).is_err());
        assert!(fraction("restitution", 0.0).is_ok() && fraction("restitution", 1.0).is_ok());
        assert!(fraction("restitution", 1.000_001).is_err() && fraction("restitution", f32::NAN).is_err());
        assert!(finite("gravity", Vec3::new(0.0, f32::NAN, 0.0)).is_err());
    }
}
