//! What queries look at: colliders, particles and nets as solids.

use bevy::math::DVec3;

use crate::nets::{NetBody, NetFeature};
use crate::solver::{Crossing, Nearest, PlacedShape, Simplex};

/// A collider, particle or net.
pub(super) enum Body<'a> {
    Collider(PlacedShape),
    Particle(Simplex),
    Net(NetBody<'a>),
}

/// What was found of a body.
pub(super) struct Found {
    /// Of a cast the part of the way; else the distance from the surface, m, negative inside.
    pub measure: f64,
    /// Of the surface, m.
    pub point: DVec3,
    /// Out of the surface.
    pub normal: DVec3,
    /// Of a net.
    pub feature: Option<NetFeature>,
}

impl Body<'_> {
    /// Where a ball first touches it on the way of its centre.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Found> {
        let (Crossing { time, foot, normal }, feature) = match self {
            Self::Collider(shape) => (shape.cast(from, to, radius)?, None),
            Self::Particle(ball) => (ball.cast(from, to, radius)?, None),
            Self::Net(net) => {
                let (crossing, feature) = net.cast(from, to, radius)?;
                (crossing, Some(feature))
            }
        };
        Some(Found { measure: time, point: foot, normal, feature })
    }

    /// The nearest point of its surface, at most `within` m away.
    pub fn nearest(&self, point: DVec3, within: f64) -> Option<Found> {
        let (Nearest { distance, normal }, feature) = match self {
            Self::Collider(shape) => (shape.nearest(point), None),
            Self::Particle(ball) => (ball.nearest(point), None),
            Self::Net(net) => {
                let (nearest, feature) = net.nearest(point, within)?;
                (nearest, Some(feature))
            }
        };
        let foot = point - normal * distance;
        (distance <= within).then_some(Found { measure: distance, point: foot, normal, feature })
    }
}
