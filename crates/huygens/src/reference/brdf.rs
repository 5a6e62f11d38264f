//! The reflection of glTF 2.0, appendix B: the twin of `shaders/common/brdf.glsl`, and how to sample it.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec2, Vec3};

use crate::sampling::cosine_direction;

/// What a point of a surface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brdf {
    /// Linear base colour, 0…1.
    pub base: Vec3,
    /// Metalness, 0…1.
    pub metallic: f32,
    /// Perceptual roughness, 0…1.
    pub roughness: f32,
    /// Factor of the dielectric specular reflection, 0…1.
    pub specular: f32,
}

/// Trowbridge & Reitz 1975: distribution of microfacet normals. The sine comes from the cross product: 1 − cos² has
/// too few digits where the lobe is narrow.
fn d_ggx(n: Vec3, h: Vec3, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let f = n.cross(h).length_squared() + n.dot(h).powi(2) * a2;
    a2 / (PI * f * f)
}

/// Heitz 2014: height-correlated Smith masking-shadowing over 4 (n·l)(n·v).
fn v_smith_ggx_correlated(n_l: f32, n_v: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let v = n_l * (n_v * n_v * (1.0 - a2) + a2).sqrt();
    let l = n_v * (n_l * n_l * (1.0 - a2) + a2).sqrt();
    0.5 / (v + l).max(1e-6)
}

/// Smith's masking alone.
fn g1_ggx(n_v: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    2.0 * n_v / (n_v + (n_v * n_v * (1.0 - a2) + a2).sqrt())
}

/// Schlick 1994.
fn f_schlick(f0: Vec3, f90: f32, v_h: f32) -> Vec3 {
    f0 + (Vec3::splat(f90) - f0) * (1.0 - v_h).clamp(0.0, 1.0).powi(5)
}

impl Brdf {
    /// The BRDF, 1/sr, for unit normal and unit vectors to the light and to the viewer.
    pub fn value(&self, n: Vec3, l: Vec3, v: Vec3) -> Vec3 {
        self.value_within(n, l, v, f32::INFINITY)
    }

    /// The same, but for its Fresnel term the glossy lobe being `most`, 1/sr, at most.
    pub fn value_within(&self, n: Vec3, l: Vec3, v: Vec3, most: f32) -> Vec3 {
        let h = (l + v).normalize_or(n);
        let (n_l, n_v) = (n.dot(l).max(0.0), n.dot(v).abs().max(1e-4));
        let v_h = v.dot(h).clamp(0.0, 1.0);
        let alpha = self.alpha();
        let f = f_schlick(self.f0(), self.f90(), v_h);
        let diffuse = self.base * (1.0 - self.metallic) / PI;
        (Vec3::ONE - f) * diffuse + f * (d_ggx(n, h, alpha) * v_smith_ggx_correlated(n_l, n_v, alpha)).min(most)
    }

    /// A direction to the light, from three numbers in [0, 1), with density [`Brdf::pdf`]; it may lie below the
    /// surface, where the BRDF is not defined.
    pub fn sample(&self, n: Vec3, v: Vec3, [choice, x, y]: [f32; 3]) -> Vec3 {
        let to_world = Quat::from_rotation_arc(Vec3::Z, n);
        let v = upper(to_world.inverse() * v);
        let l = if choice < self.specular_share(v.z) {
            let h = sample_visible_normal(v, self.alpha(), Vec2::new(x, y));
            2.0 * v.dot(h) * h - v
        } else {
            cosine_direction([x, y])
        };
        to_world * l
    }

    /// Density, 1/sr, with which [`Brdf::sample`] gives the unit vector `l`.
    pub fn pdf(&self, n: Vec3, l: Vec3, v: Vec3) -> f32 {
        let to_world = Quat::from_rotation_arc(Vec3::Z, n);
        let (v, l) = (upper(to_world.inverse() * v), to_world.inverse() * l);
        let share = self.specular_share(v.z);
        let cosine = l.z.max(0.0) / PI;
        if share == 0.0 {
            return cosine;
        }
        let h = (l + v).normalize_or(Vec3::Z);
        // The reflection of a visible normal: d l = 4 (v·h) d h.
        let visible = if h.z > 0.0 && v.dot(h) > 0.0 {
            d_ggx(Vec3::Z, h, self.alpha()) * g1_ggx(v.z, self.alpha()) / (4.0 * v.z)
        } else {
            0.0
        };
        share * visible + (1.0 - share) * cosine
    }

    /// The share of light from `v` that is reflected, estimated from directions that three numbers in [0, 1) each draw;
    /// exact for a Lambertian surface.
    pub fn reflectance(&self, n: Vec3, v: Vec3, points: &[[f32; 3]]) -> Vec3 {
        if self.f90() <= 0.0 {
            return self.base;
        }
        let through = |&point: &[f32; 3]| {
            let l = self.sample(n, v, point);
            let (cosine, pdf) = (l.dot(n), self.pdf(n, l, v));
            if cosine > 0.0 && pdf > 0.0 { self.value(n, l, v) * (cosine / pdf) } else { Vec3::ZERO }
        };
        points.iter().map(through).sum::<Vec3>() / points.len() as f32
    }

    /// A mirror has no lobe that a point light could be seen in; the bound keeps the smallest one finite.
    fn alpha(&self) -> f32 {
        (self.roughness * self.roughness).max(1e-3)
    }

    fn f0(&self) -> Vec3 {
        Vec3::splat(0.04 * self.specular).lerp(self.base, self.metallic)
    }

    fn f90(&self) -> f32 {
        self.specular + (1.0 - self.specular) * self.metallic
    }

    /// The share of directions that is drawn from the specular lobe: about what it reflects of the whole.
    fn specular_share(&self, n_v: f32) -> f32 {
        let specular = f_schlick(self.f0(), self.f90(), n_v).element_sum();
        let diffuse = (self.base * (1.0 - self.metallic)).element_sum();
        match (specular > 0.0, diffuse > 0.0) {
            (false, _) => 0.0,
            (true, false) => 1.0,
            (true, true) => (specular / (specular + diffuse)).clamp(0.1, 0.9),
        }
    }
}

/// A viewer below the surface (the shading normal may lean away) is taken to be above it, as the BRDF takes it.
fn upper(v: Vec3) -> Vec3 {
    v.with_z(v.z.abs().max(1e-4))
}

/// Dupuy & Benyoub 2023, "Sampling visible GGX normals with spherical caps": `v` and the normal in tangent space.
fn sample_visible_normal(v: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let stretch = Vec3::new(alpha, alpha, 1.0);
    let v = (v * stretch).normalize();
    let angle = TAU * u.x;
    let z = (1.0 - u.y) * (1.0 + v.z) - v.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let cap = Vec3::new(radius * angle.cos(), radius * angle.sin(), z);
    ((cap + v) * stretch).normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MATERIALS: [Brdf; 5] = [
        Brdf { base: Vec3::new(0.8, 0.5, 0.2), metallic: 0.0, roughness: 1.0, specular: 0.0 },
        Brdf { base: Vec3::new(0.8, 0.5, 0.2), metallic: 0.0, roughness: 0.6, specular: 1.0 },
        Brdf { base: Vec3::new(0.8, 0.5, 0.2), metallic: 1.0, roughness: 0.4, specular: 1.0 },
        Brdf { base: Vec3::ONE, metallic: 1.0, roughness: 0.9, specular: 1.0 },
        Brdf { base: Vec3::new(0.1, 0.2, 0.9), metallic: 0.5, roughness: 0.7, specular: 0.5 },
    ];

    /// The middle of every cell of a grid over the sphere, with the cell's solid angle; z = `axis`.
    fn sphere(axis: Vec3, steps: usize) -> impl Iterator<Item = (Vec3, f64)> {
        let (x, y) = axis.any_orthonormal_pair();
        let cell = 4.0 * std::f64::consts::PI / (steps * 2 * steps) as f64;
        (0..steps * 2 * steps).map(move |i| {
            let z = -1.0 + 2.0 * ((i / (2 * steps)) as f32 + 0.5) / steps as f32;
            let angle = PI * ((i % (2 * steps)) as f32 + 0.5) / steps as f32;
            let radius = (1.0 - z * z).sqrt();
            (x * (radius * angle.cos()) + y * (radius * angle.sin()) + axis * z, cell)
        })
    }

    fn viewers() -> [(Vec3, Vec3); 3] {
        let n = Vec3::new(0.3, 0.8, -0.5).normalize();
        let (x, y) = n.any_orthonormal_pair();
        [0.05, 0.6, 1.3].map(|theta: f32| (n, n * theta.cos() + (x * 0.6 + y * 0.8) * theta.sin()))
    }

    #[test]
    fn pdf_integrates_to_one() {
        for brdf in MATERIALS {
            for (n, v) in viewers() {
                let sum: f64 = sphere(n, 800).map(|(l, cell)| f64::from(brdf.pdf(n, l, v)) * cell).sum();
                assert!((sum - 1.0).abs() < 2e-3, "{brdf:?} {v}: {sum}");
            }
        }
    }

    /// Samples fall into cells of the sphere as often as the pdf says (χ², a significance of 1e-4 for all cases).
    #[test]
    fn samples_have_the_density_of_the_pdf() {
        let (rows, columns, count) = (10, 12, 200_000);
        for brdf in MATERIALS {
            for (n, v) in viewers() {
                let (x, y) = n.any_orthonormal_pair();
                let cell_of = |l: Vec3| {
                    let row = ((l.dot(n) + 1.0) * 0.5 * rows as f32) as usize;
                    let angle = l.dot(y).atan2(l.dot(x)).rem_euclid(TAU);
                    row.min(rows - 1) * columns + ((angle / TAU * columns as f32) as usize).min(columns - 1)
                };
                let mut expected = vec![0.0; rows * columns];
                for (l, solid_angle) in sphere(n, 600) {
                    expected[cell_of(l)] += f64::from(brdf.pdf(n, l, v)) * solid_angle * f64::from(count);
                }
                let mut found = vec![0.0; rows * columns];
                for i in 0..count {
                    // Independent numbers: stratified ones would fit better than chance.
                    let u = [0, 1, 2].map(|k| crate::sampling::random(7, k, i));
                    found[cell_of(brdf.sample(n, v, u))] += 1.0;
                }
                let (mut chi2, mut cells, mut rest) = (0.0, 0.0, (0.0, 0.0));
                for (&e, &f) in expected.iter().zip(&found) {
                    if e >= 20.0 {
                        chi2 += (f - e) * (f - e) / e;
                        cells += 1.0;
                    } else {
                        rest = (rest.0 + e, rest.1 + f);
                    }
                }
                if rest.0 >= 20.0 {
                    chi2 += (rest.1 - rest.0) * (rest.1 - rest.0) / rest.0;
                    cells += 1.0;
                } else {
                    assert!(rest.1 < 60.0, "{brdf:?}: {rest:?} where there should be next to none");
                }
                // Wilson & Hilferty: χ² with k degrees of freedom, 1 − 1e-4/15 is 4.35 σ. The grid's own error in
                // `expected`, at most 0.3 % of a cell, adds count · 0.003² per unit of probability.
                let k: f64 = cells - 1.0;
                let limit = k * (1.0 - 2.0 / (9.0 * k) + 4.35 * (2.0 / (9.0 * k)).sqrt()).powi(3);
                let grid = f64::from(count) * 0.003 * 0.003;
                assert!(chi2 < limit + grid, "{brdf:?} {v}: χ² {chi2:.1} of {k} degrees, limit {limit:.1}");
            }
        }
    }

    /// What a white lobe reflects: by sampling and by quadrature, never more than comes in.
    #[test]
    fn energy_of_the_ggx_lobe() {
        let mut at_roughness = Vec::new();
        for roughness in [0.0, 0.3, 0.6, 1.0] {
            let brdf = Brdf { base: Vec3::ONE, metallic: 1.0, roughness, specular: 1.0 };
            for (n, v) in viewers() {
                let points: Vec<[f32; 3]> = (0..4096)
                    .map(|i| {
                        let [a, b, c, _] = sobol_burley::sample_4d(i, 0, 1);
                        [a, b, c]
                    })
                    .collect();
                let energy = f64::from(brdf.reflectance(n, v, &points).x);
                assert!(energy < 1.0 + 1e-3, "roughness {roughness}, {v}: {energy}");
                if roughness >= 0.3 {
                    let exact: f64 = sphere(n, 1200)
                        .filter(|(l, _)| n.dot(*l) > 0.0)
                        .map(|(l, cell)| f64::from(brdf.value(n, l, v).x * n.dot(l)) * cell)
                        .sum();
                    assert!((energy - exact).abs() < 4e-3, "roughness {roughness}, {v}: {energy}, exact {exact}");
                }
                at_roughness.push(energy);
            }
        }
        // A mirror loses nothing; a rough surface loses what would be reflected twice between its facets.
        assert!(at_roughness[..3].iter().all(|e| *e > 0.995), "{at_roughness:?}");
        assert!(at_roughness[9..].iter().all(|e| *e < 0.9), "{at_roughness:?}");
    }

    #[test]
    fn lambert_alone_is_albedo_over_pi_and_is_sampled_by_the_cosine() {
        let (brdf, (n, v)) = (MATERIALS[0], viewers()[1]);
        for i in 0..100 {
            let u = [0, 1, 2].map(|k| crate::sampling::random(3, k, i));
            let l = brdf.sample(n, v, u);
            assert!((l.length() - 1.0).abs() < 1e-5 && n.dot(l) >= -1e-6);
            assert!((brdf.value(n, l, v) * PI - brdf.base).abs().max_element() < 1e-6);
            assert!((brdf.pdf(n, l, v) - n.dot(l).max(0.0) / PI).abs() < 1e-5);
        }
    }
}
