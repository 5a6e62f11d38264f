//! The sum over the VPLs in double precision: the twin of the pass `gather`.

use glam::{DVec3, Vec3};

use crate::lattice::{Emission, Vpl};

/// Irradiance, W/m², at `position` (m) with unit `normal` from the VPLs that `visible` (by index) lets through:
/// `E = Σ I_v · w · max(0, n·ω) · V_v / max(d, d_min)²`, w = 1 in front of the VPL and ½ behind it; for a Lambertian
/// VPL the cosine in front and 0 behind.
/// `visible` is asked only about VPLs that would count.
pub fn irradiance(vpls: &[Vpl], position: Vec3, normal: Vec3, mut visible: impl FnMut(usize) -> bool) -> DVec3 {
    let (position, normal) = (position.as_dvec3(), normal.as_dvec3());
    let mut sum = DVec3::ZERO;
    for (index, vpl) in vpls.iter().enumerate() {
        let d = position - vpl.position.as_dvec3();
        let cosine = -normal.dot(d.normalize_or_zero());
        let along = d.normalize_or_zero().dot(vpl.direction.as_dvec3());
        let weight = match vpl.emission {
            Emission::Wavelet => {
                if along >= 0.0 {
                    1.0
                } else {
                    0.5
                }
            }
            Emission::Lambertian => along.max(0.0),
        };
        let bound = f64::from(vpl.d_min).powi(2);
        if cosine > 0.0 && weight > 0.0 && visible(index) {
            sum += vpl.intensity.as_dvec3() * (weight * cosine / d.length_squared().max(bound));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_vpl_in_front_behind_near_and_from_below() {
        let vpl = Vpl {
            position: Vec3::ZERO,
            direction: Vec3::Z,
            intensity: Vec3::new(3.0, 2.0, 1.0),
            d_min: 0.5,
            emission: Emission::Wavelet,
        };
        let at = |position, normal| irradiance(&[vpl], position, normal, |_| true).x;
        assert!((at(Vec3::new(0.0, 0.0, 2.0), Vec3::NEG_Z) - 3.0 / 4.0).abs() < 1e-12);
        assert!((at(Vec3::new(0.0, 0.0, -2.0), Vec3::Z) - 3.0 / 8.0).abs() < 1e-12);
        assert!((at(Vec3::new(0.0, 0.0, 0.1), Vec3::NEG_Z) - 3.0 / 0.25).abs() < 1e-6);
        assert_eq!(at(Vec3::new(0.0, 0.0, 2.0), Vec3::Z), 0.0);
        assert_eq!(irradiance(&[vpl], Vec3::Z, Vec3::NEG_Z, |_| false), DVec3::ZERO);
    }
}
