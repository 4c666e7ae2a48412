//! Contacts: their points, normals and impulses.

use bevy::ecs::message::MessageRegistry;
use bevy::prelude::*;

use super::MassSpringGizmos;
use crate::collider::Contact;
use crate::report::TickReport;

/// Length of the cross where two touch, m.
const CROSS: f32 = 0.03;
/// Length of the arrow of an impulse that would hardly be seen, m.
const MIN_ARROW: f32 = 0.04;

/// Has contacts collected as long as they are drawn, in apps that do not ask for them anyway.
pub(super) fn collect_contacts(
    store: Res<GizmoConfigStore>,
    messages: Option<Res<Messages<Contact>>>,
    mut are_ours: Local<bool>,
    mut commands: Commands,
) {
    let (config, gizmos) = store.config::<MassSpringGizmos>();
    let are_drawn = config.enabled && gizmos.contacts;
    if are_drawn && messages.is_none() {
        *are_ours = true;
        commands.queue(|world: &mut World| MessageRegistry::register_message::<Contact>(world));
    } else if !are_drawn && std::mem::take(&mut *are_ours) {
        commands.queue(|world: &mut World| MessageRegistry::deregister_messages::<Contact>(world));
    }
}

/// Draws the contacts of the last ticks: a cross where two touch, an arrow along the normal as long as the impulse says.
pub(super) fn draw_contacts(
    mut gizmos: Gizmos<MassSpringGizmos>,
    mut contacts: MessageReader<Contact>,
    report: Option<Res<TickReport>>,
    mut last: Local<Vec<Contact>>,
    mut drawn_tick: Local<u64>,
) {
    if !gizmos.config_ext.contacts {
        contacts.clear();
        last.clear();
        return;
    }
    // Frames without a tick show those of the last one that had.
    let tick = report.map_or(0, |report| report.tick);
    if std::mem::replace(&mut *drawn_tick, tick) != tick || !contacts.is_empty() {
        last.clear();
        last.extend(contacts.read());
    }
    let MassSpringGizmos { contact_color, contact_scale, .. } = *gizmos.config_ext;
    for contact in &*last {
        gizmos.cross(Isometry3d::from_translation(contact.point), CROSS, contact_color);
        let length = (contact.impulse * contact_scale).max(MIN_ARROW);
        gizmos.arrow(contact.point, contact.point + contact.normal * length, contact_color);
    }
}
