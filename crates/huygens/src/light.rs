//! Lights: position, axis, intensity and emission profile.

use std::f32::consts::PI;

use glam::Vec3;

/// How the intensity of a light falls off with the angle θ from its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Profile {
    /// The same in the whole hemisphere around the axis, nothing behind.
    Uniform,
    /// Lambertian: the cosine of θ in the hemisphere around the axis, nothing behind.
    Cosine,
    /// A cone (KHR_lights_punctual): full within `inner`, none beyond `outer`, the specification's square law
    /// between. Angles from the axis in radians, 0 ≤ inner < outer ≤ π/2.
    Spot {
        /// Angle from the axis up to which the light has its full intensity.
        inner: f32,
        /// Angle from the axis beyond which it gives nothing.
        outer: f32,
    },
    /// The same in every direction of the whole sphere (a glTF point light).
    Point,
    /// Parallel rays along the axis from infinitely far away; `intensity` is then an irradiance (W/m²) on a surface
    /// across the rays.
    Directional,
}

impl Profile {
    /// Share of the intensity that goes in a direction at `cos_theta` from the axis, 0…1.
    pub fn value(&self, cos_theta: f32) -> f32 {
        match *self {
            Profile::Uniform => (cos_theta >= 0.0) as u32 as f32,
            Profile::Cosine => cos_theta.max(0.0),
            Profile::Spot { .. } => {
                let [scale, offset] = self.cone();
                (cos_theta * scale + offset).clamp(0.0, 1.0).powi(2)
            }
            Profile::Point | Profile::Directional => 1.0,
        }
    }

    /// Scale and offset of a spot's falloff, `clamp(cos θ · scale + offset, 0, 1)²`, as KHR_lights_punctual
    /// has it, but for narrower cones too (it lets scale grow to 1000).
    pub fn cone(&self) -> [f32; 2] {
        match *self {
            Profile::Spot { inner, outer } => {
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-7);
                [scale, -outer.cos() * scale]
            }
            _ => [0.0, 1.0],
        }
    }

    /// `∫ value dω` over all directions, in steradians: flux over intensity. A directional light has no flux of its
    /// own; it counts 0 here.
    pub fn solid_angle(&self) -> f32 {
        match *self {
            Profile::Uniform => 2.0 * PI,
            Profile::Cosine => PI,
            Profile::Spot { inner, outer } => 2.0 * PI * ((1.0 - inner.cos()) + (inner.cos() - outer.cos()) / 3.0),
            Profile::Point => 4.0 * PI,
            Profile::Directional => 0.0,
        }
    }
}

/// A light in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name in the file; empty if it has none.
    pub name: String,
    /// Position, metres, world space. Without meaning for a directional light.
    pub position: Vec3,
    /// Unit vector of the direction that the light faces, world space.
    pub axis: Vec3,
    /// Linear RGB intensity on the axis, W/sr (glTF's candela is used as the same number); for a directional light
    /// the irradiance in W/m² (glTF's lux).
    pub intensity: Vec3,
    /// Emission profile around the axis.
    pub profile: Profile,
}

impl Light {
    /// Flux per channel, W. For a directional light the flux through the disc of `scene_radius` metres that the
    /// scene shows it.
    pub fn flux(&self, scene_radius: f32) -> Vec3 {
        match self.profile {
            Profile::Directional => self.intensity * PI * scene_radius * scene_radius,
            profile => self.intensity * profile.solid_angle(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solid_angle_is_the_integral_of_the_profile() {
        let spot = Profile::Spot { inner: 0.2, outer: 0.9 };
        for profile in [Profile::Uniform, Profile::Cosine, spot, Profile::Point] {
            let steps = 100_000;
            let sum: f64 =
                (0..steps).map(|i| f64::from(profile.value(-1.0 + 2.0 * (i as f32 + 0.5) / steps as f32))).sum();
            let integral = sum * 2.0 / f64::from(steps) * std::f64::consts::TAU;
            assert!((integral / f64::from(profile.solid_angle()) - 1.0).abs() < 1e-4, "{profile:?}: {integral}");
        }
    }
}
