//! The pure core.
/// An explicit integration scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scheme {
    /// a
    ExplicitEuler,
    /// a
    SemiImplicitEuler,
    /// a
    SecondOrderTaylor,
    /// a
    VelocityVerlet,
    /// a
    RungeKutta4,
}
