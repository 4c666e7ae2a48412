//! stub
/// stub
pub struct ParticleDragPlugin;
