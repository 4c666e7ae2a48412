//! stub
/// stub
pub struct MassSpringPanelPlugin;
