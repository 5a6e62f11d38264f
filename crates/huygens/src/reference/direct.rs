//! Direct light: the twin of the pass `direct`.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::surface::{Surface, Surfaces};
use crate::{Light, Profile, Scene};

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

/// Radiance, W/(m² sr), that a surface reflects toward the unit vector `v` from all lights of the scene that it sees:
/// `L = Σ f(v, l) · I(ω) · max(0, n·l) · V / d²`.
pub fn radiance(surfaces: &Surfaces, surface: &Surface, v: Vec3) -> Vec3 {
    let scene: &Scene = surfaces.scene;
    let mut sum = Vec3::ZERO;
    for light in &scene.lights {
        let parallel = light.profile == Profile::Directional;
        let to_light = if parallel { -light.axis } else { light.position - surface.position };
        let Some(l) = to_light.try_normalize() else { continue };
        // Light from below the surface itself is no light, whatever the shading normal says.
        if l.dot(surface.geometric_normal) <= 0.0 || l.dot(surface.normal) <= 0.0 {
            continue;
        }
        let value = light.profile.value(-l.dot(light.axis));
        if value <= 0.0 {
            continue;
        }
        let start = surface.start(l);
        let hidden = if parallel { surfaces.hits(start, l) } else { surfaces.occluded(start, light.position) };
        if hidden {
            continue;
        }
        let d2 = if parallel { 1.0 } else { to_light.length_squared().max(1e-36) };
        sum += surface.brdf.value(surface.normal, l, v) * light.intensity * (value * l.dot(surface.normal) / d2);
    }
    sum
}
