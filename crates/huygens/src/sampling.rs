//! Random choices that are the same on every machine.

use glam::Vec3;

use crate::lattice::Vpl;

/// PCG hash (Jarzynski & Olano 2020, "Hash functions for GPU rendering"); `common/ism_surfel.glsl` has the same.
pub fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A number in [0, 1) from seed, frame and index.
pub fn random(seed: u32, frame: u32, index: u32) -> f32 {
    (hash(index ^ hash(frame ^ hash(seed))) >> 8) as f32 / 16_777_216.0
}

/// The stochastic fraction: each VPL is on or off by a hash of seed, frame and index; survivors are
/// scaled by 1 / fraction. VPLs that carry nothing are left out.
pub fn stochastic_fraction(vpls: &[Vpl], fraction: f32, seed: u32, frame: u32) -> Vec<Vpl> {
    let survives = |index: usize| fraction >= 1.0 || random(seed, frame, index as u32) < fraction;
    vpls.iter()
        .enumerate()
        .filter(|(index, vpl)| vpl.intensity.max_element() > 0.0 && survives(*index))
        .map(|(_, vpl)| Vpl { intensity: vpl.intensity / fraction, ..*vpl })
        .collect()
}

/// `count` VPLs drawn in proportion to their power by one systematic sample, scaled up so that each expects its own
/// share and the total power stays. A VPL that is drawn more than once is taken once with the sum.
pub fn by_power(vpls: &[Vpl], count: u32, seed: u32, frame: u32) -> Vec<Vpl> {
    let powers: Vec<f64> = vpls.iter().map(|vpl| f64::from(vpl.intensity.element_sum())).collect();
    by_weight(vpls, &powers, count, seed, frame)
}

/// As [`by_power`], but each in proportion to a weight of its own.
pub fn by_weight(vpls: &[Vpl], weights: &[f64], count: u32, seed: u32, frame: u32) -> Vec<Vpl> {
    let total: f64 = weights.iter().sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let step = total / f64::from(count);
    let mut next = step * f64::from(random(seed, frame, u32::MAX));
    let mut reached = 0.0;
    let mut sample = Vec::new();
    for (vpl, weight) in vpls.iter().zip(weights) {
        reached += weight;
        let mut drawn = 0u32;
        while next < reached {
            drawn += 1;
            next += step;
        }
        if drawn > 0 {
            let scale = (f64::from(drawn) * step / weight) as f32;
            sample.push(Vpl { intensity: vpl.intensity * scale, ..*vpl });
        }
    }
    sample
}

/// A direction around z with the density cos θ / π, 1/sr, from two numbers in [0, 1): Malley's method, the cosine above
/// a disc.
pub(crate) fn cosine_direction([x, y]: [f32; 2]) -> Vec3 {
    let (radius, angle) = (x.sqrt(), std::f32::consts::TAU * y);
    Vec3::new(radius * angle.cos(), radius * angle.sin(), (1.0 - x).max(0.0).sqrt())
}

/// Weights of a triangle's corners, even over its area, from two numbers in [0, 1): Shirley & Chiu's square-root map.
pub(crate) fn on_triangle([x, y]: [f32; 2]) -> Vec3 {
    let root = x.sqrt();
    Vec3::new(1.0 - root, root * (1.0 - y), root * y)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::lattice::Emission;

    fn vpls(count: usize) -> Vec<Vpl> {
        (0..count)
            .map(|i| Vpl {
                position: Vec3::splat(i as f32),
                direction: Vec3::Z,
                intensity: Vec3::splat(if i % 10 == 0 { 0.0 } else { 1.0 + (i % 7) as f32 }),
                d_min: 0.0,
                extent: [0.0; 4],
                emission: Emission::Wavelet,
            })
            .collect()
    }

    fn power(vpls: &[Vpl]) -> f64 {
        vpls.iter().map(|v| f64::from(v.intensity.element_sum())).sum()
    }

    #[test]
    fn the_hash_is_that_of_the_paper() {
        // Values of the published pcg_hash, computed by hand from its definition in 32-bit arithmetic.
        assert_eq!([hash(0), hash(1), hash(12345)], [129_708_002, 2_831_084_092, 4_099_845_390]);
    }

    #[test]
    fn fraction_is_deterministic_and_keeps_the_total_on_average() {
        let all = vpls(6485);
        assert_eq!(stochastic_fraction(&all, 1.0, 3, 0).len(), all.iter().filter(|v| v.intensity.x > 0.0).count());
        let quarter = stochastic_fraction(&all, 0.25, 3, 0);
        assert_eq!(quarter, stochastic_fraction(&all, 0.25, 3, 0));
        assert_ne!(quarter, stochastic_fraction(&all, 0.25, 4, 0));
        assert_ne!(quarter, stochastic_fraction(&all, 0.25, 3, 1));
        let mean: f64 = (0..64).map(|f| power(&stochastic_fraction(&all, 0.25, 3, f))).sum::<f64>() / 64.0;
        assert!((mean / power(&all) - 1.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn sampling_by_power_keeps_the_total_and_the_count() {
        let all = vpls(6485);
        for count in [1, 64, 1000, 8192] {
            let sample = by_power(&all, count, 1, 0);
            assert!(sample.len() <= count as usize && (count > 1000 || sample.len() == count as usize));
            assert!((power(&sample) / power(&all) - 1.0).abs() < 1e-5);
        }
        assert!(by_power(&vpls(1), 8, 1, 0).is_empty());
        // Every VPL is drawn in proportion to its power.
        let mut drawn = vec![0.0; all.len()];
        for frame in 0..2000 {
            for vpl in by_power(&all, 64, 9, frame) {
                drawn[vpl.position.x as usize] += f64::from(vpl.intensity.x) / 2000.0;
            }
        }
        for first in (0..all.len()).step_by(500) {
            let range = first..(first + 500).min(all.len());
            let expected: f64 = all[range.clone()].iter().map(|v| f64::from(v.intensity.x)).sum();
            let got: f64 = drawn[range].iter().sum();
            assert!((got / expected - 1.0).abs() < 0.02, "{first}: {got} {expected}");
        }
    }
}
