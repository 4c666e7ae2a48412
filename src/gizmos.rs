//! stub
/// stub
pub struct MassSpringGizmosPlugin;
/// stub
pub struct MassSpringGizmos;
