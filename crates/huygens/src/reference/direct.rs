//! Direct light of a Lambertian surface: the twin of the pass `direct` without its shadow map.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use crate::{Light, Profile};

/// Radiance, W/(m² sr), of a Lambertian surface of that albedo at `position` (m) with unit `normal`, lit by one light
/// that nothing hides: `L = ρ/π · I(ω) · max(0, n·ω) / d²`.
pub fn lambert(light: &Light, albedo: Vec3, position: Vec3, normal: Vec3) -> DVec3 {
    let (to_light, d2) = match light.profile {
        Profile::Directional => (-light.axis.as_dvec3(), 1.0),
        _ => {
            let d = light.position.as_dvec3() - position.as_dvec3();
            (d.normalize_or_zero(), d.length_squared())
        }
    };
    let value = light.profile.value(-to_light.dot(light.axis.as_dvec3()) as f32);
    let cosine = to_light.dot(normal.as_dvec3()).max(0.0);
    albedo.as_dvec3() / PI * light.intensity.as_dvec3() * (f64::from(value) * cosine / d2.max(1e-36))
}
