//! stub
/// stub
pub struct MassSpringScene;
/// stub
pub struct MassSpringSceneRoot;
