//! The lattice of virtual point lights: rays over the hemisphere around the primary light, VPLs on
//! them in shells. It needs no GL: the renderer hands it what the light's shadow map holds along each ray.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Mat3, Vec3};

use crate::settings::{Attenuation, Depth, Energy, Tint, Wave, Weighting};
use crate::{Error, Light, Profile, Result};

/// Largest mean albedo in the energy rule: at 0.95 the lattice already has 19 times the light's flux.
const MAX_MEAN_ALBEDO: f32 = 0.95;

/// One ray of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Angle off the light's axis, radians, 0…π/2.
    pub theta: f32,
    /// Angle around the axis, radians, 0…2π.
    pub phi: f32,
    /// Unit vector in light space (z along the light's axis).
    pub direction_ls: Vec3,
    /// Solid angle of the ray's cell, sr; all cells together are the hemisphere, 2π.
    pub solid_angle: f32,
}

/// One hemisphere of VPLs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    /// Distance from the light as a share of the depth, `f_s`.
    pub distance: f32,
    /// Attenuation `a_s`, 0…1.
    pub attenuation: f32,
}

/// What the light's shadow map holds.
#[derive(Clone, Debug, Default)]
pub struct LightProbe {
    /// Farthest depth in the map, m; `None` if there is nothing in it.
    pub scene_depth: Option<f32>,
    /// For each ray: the distance along it (m; `None` if it meets nothing) and the mean linear albedo of its cell
    /// (what is not there counts as black).
    pub rays: Vec<(Option<f32>, Vec3)>,
}

/// What stands around the light.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// From [`Lattice::frame`].
    pub frame: (Vec3, Mat3),
    /// Radius of the sphere around the scene, m.
    pub radius: f32,
    /// Mean linear albedo of the scene's surfaces.
    pub albedo: Vec3,
    /// Distance below which a VPL gets no brighter, as a share of the depth of the scene.
    pub d_min: f32,
    /// What the light's shadow map holds.
    pub probe: &'a LightProbe,
}

/// How a VPL sends its light out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Emission {
    /// A wavelet of the lattice: full radiance in front, half of it behind.
    Wavelet,
    /// A surface: the cosine of the angle to the direction, nothing behind.
    Lambertian,
}

/// A virtual point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vpl {
    /// Position, m, world space.
    pub position: Vec3,
    /// Unit vector of the side that gets full radiance.
    pub direction: Vec3,
    /// Linear RGB intensity along the direction, W/sr.
    pub intensity: Vec3,
    /// Distance, m, below which it gets no brighter; of a Lambertian one the radius of a disc as large as its patch.
    pub d_min: f32,
    /// How far, m, the rectangle that a Lambertian one stands for goes along −x, x, −y and y of its [`Vpl::frame`].
    pub extent: [f32; 4],
    /// How its intensity depends on the direction.
    pub emission: Emission,
}

impl Vpl {
    /// A Lambertian VPL that stands for a square around it, as large as a disc of that radius, m.
    pub(crate) fn lambertian(position: Vec3, direction: Vec3, intensity: Vec3, radius: f32) -> Self {
        let extent = [0.5 * PI.sqrt() * radius; 4];
        Self { position, direction, intensity, d_min: radius, extent, emission: Emission::Lambertian }
    }

    /// The unit vectors x and y along which the rectangle of a VPL lies that faces in such a direction.
    pub fn frame(direction: Vec3) -> [Vec3; 2] {
        let x = if direction.z.abs() < 0.9 { Vec3::Z } else { Vec3::X }.cross(direction).normalize();
        [x, direction.cross(x)]
    }

    /// Distance, m, within which a Lambertian one is its rectangle, and beyond which a point: 4 radii of a square's disc.
    pub(crate) fn near(&self) -> f32 {
        let [left, right, back, front] = self.extent;
        3.2 * left.max(right).hypot(back.max(front))
    }

    /// Flux that the VPL sends out, W.
    pub fn flux(&self) -> Vec3 {
        let angle = match self.emission {
            // A full hemisphere and half of one.
            Emission::Wavelet => 3.0 * PI,
            Emission::Lambertian => PI,
        };
        self.intensity * angle
    }
}

/// Directions and distances of the lattice, without a light.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Rays, the axis first, then ring by ring.
    pub rays: Vec<Ray>,
    /// Shells from the light outward.
    pub shells: Vec<Shell>,
    /// Steps Δθ and Δφ, radians.
    pub steps: [f32; 2],
}

/// The VPLs of a lattice around a light, and the numbers of the energy rule.
#[derive(Clone, Debug)]
pub struct Wavefront {
    /// `rays · shells` VPLs, ray by ray, each from the light outward.
    pub vpls: Vec<Vpl>,
    /// Depth `R` of the scene, m.
    pub scene_depth: f32,
    /// Albedo that the light sees on average, ρ̄, 0…0.95.
    pub mean_albedo: f32,
    /// Share of reflected light that is reflected once more, 0…0.95: ρ̄, or with [`Energy::Received`] the albedo of
    /// the whole scene times the share of the lattice's rays that meet something.
    pub later_albedo: f32,
    /// Flux of the light, W, the sum of the channels.
    pub light_flux: f64,
    /// Flux that all VPLs emit, W, the sum of the channels.
    pub lattice_flux: f64,
    /// Flux of all VPLs as the rule counts it, W, the sum of the channels: Φ · ρ̄/(1−ρ) times the strength, with ρ the
    /// later albedo.
    pub counted_flux: f64,
}

impl Lattice {
    /// Rays every Δθ and Δφ, and S shells at `reach · ratio^(s−S)` with attenuations `0.8 · 2^(s−S)`.
    pub fn new(wave: &Wave) -> Result<Self> {
        let rings = steps("wave.delta_theta", wave.delta_theta, 90.0)?;
        let sectors = steps("wave.delta_phi", wave.delta_phi, 360.0)?;
        // In f64: cos is flat near the axis, where the cells are smallest.
        let theta = |ring: f64| (ring / f64::from(rings)).min(1.0) * std::f64::consts::FRAC_PI_2;
        let band = |ring: u32| theta((f64::from(ring) - 0.5).max(0.0)).cos() - theta(f64::from(ring) + 0.5).cos();
        let mut rays = vec![Ray {
            theta: 0.0,
            phi: 0.0,
            direction_ls: Vec3::Z,
            solid_angle: (std::f64::consts::TAU * band(0)) as f32,
        }];
        for ring in 1..=rings {
            for sector in 0..sectors {
                let phi = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
                let (sin_theta, mut cos_theta) = theta(f64::from(ring)).sin_cos();
                // The last ring lies in the light's plane, not 6e-17 of it in front.
                if ring == rings {
                    cos_theta = 0.0;
                }
                rays.push(Ray {
                    theta: theta(f64::from(ring)) as f32,
                    phi: phi as f32,
                    direction_ls: Vec3::new(
                        (sin_theta * phi.cos()) as f32,
                        (sin_theta * phi.sin()) as f32,
                        cos_theta as f32,
                    ),
                    solid_angle: (std::f64::consts::TAU / f64::from(sectors) * band(ring)) as f32,
                });
            }
        }
        let shells = (1..=wave.shells)
            .map(|s| {
                let inward = s as f32 - wave.shells as f32;
                Shell { distance: wave.reach * wave.ratio.powf(inward), attenuation: 0.8 * inward.exp2() }
            })
            .collect();
        let steps = [FRAC_PI_2 / rings as f32, TAU / sectors as f32];
        Ok(Self { rays, shells, steps })
    }

    /// Where the lattice stands around a light: its centre and the rotation from light space to world space. A
    /// directional light is taken to stand on the sphere around the scene.
    pub fn frame(light: &Light, scene_center: Vec3, scene_radius: f32) -> (Vec3, Mat3) {
        let (x, y) = light.axis.any_orthonormal_pair();
        let center = match light.profile {
            Profile::Directional => scene_center - light.axis * scene_radius,
            _ => light.position,
        };
        (center, Mat3::from_cols(x, y, light.axis))
    }

    /// The VPLs around a light.
    pub fn wavefront(&self, wave: &Wave, strength: f32, light: &Light, around: &Surroundings) -> Wavefront {
        let &Surroundings { frame: (center, world_from_light), radius, probe, .. } = around;
        let light_flux = light.flux(radius);
        let scene_depth = probe.scene_depth.filter(|&depth| depth > 0.0).unwrap_or(radius);
        let bound = around.d_min * scene_depth;

        // The profile of a light that is not a point stands for the share of flux in a direction all the same: a
        // directional light on the sphere around the scene reaches a chord's worth of it, hence the cosine.
        let profile = match light.profile {
            Profile::Directional => Profile::Cosine,
            profile => profile,
        };
        let beam: Vec<f64> = self
            .rays
            .iter()
            .map(|ray| f64::from(ray.solid_angle) * f64::from(profile.value(ray.direction_ls.z)))
            .collect();
        let mean_albedo = mean_albedo(&beam, probe, light_flux);
        let total = f64::from(light_flux.element_sum());
        let later_albedo = match wave.energy {
            Energy::Emitted => mean_albedo,
            Energy::Received => self.later_albedo(around.albedo, light_flux, probe),
        };
        let counted_flux = total * f64::from(mean_albedo) / (1.0 - f64::from(later_albedo)) * f64::from(strength);

        let mut vpls = Vec::with_capacity(self.rays.len() * self.shells.len());
        let (mut emitted, mut counted) = (0.0, 0.0);
        for (i, ray) in self.rays.iter().enumerate() {
            let (hit, albedo) = probe.rays.get(i).copied().unwrap_or((None, Vec3::ZERO));
            let depth = match wave.depth {
                Depth::Scene => scene_depth,
                Depth::Ray => hit.unwrap_or(scene_depth),
            };
            let carried = match wave.weighting {
                Weighting::Uniform => 1.0,
                Weighting::SolidAngle => beam[i] as f32,
            };
            let color = match wave.tint {
                Tint::None => light.intensity,
                Tint::Surface => light.intensity * albedo,
            };
            let direction = world_from_light * ray.direction_ls;
            for shell in &self.shells {
                let kept = match wave.attenuation {
                    Attenuation::Absorbed => 1.0 - shell.attenuation,
                    Attenuation::Transmitted => shell.attenuation,
                };
                let distance = depth * shell.distance;
                let position = center + direction * distance;
                let intensity = color * (carried * kept);
                let emission = Emission::Wavelet;
                let vpl = Vpl { position, direction, intensity, d_min: bound, extent: [0.0; 4], emission };
                let flux = f64::from(vpl.flux().element_sum());
                emitted += flux;
                counted += flux
                    * match wave.energy {
                        Energy::Emitted => 1.0,
                        Energy::Received => received(hit.map(|hit| (hit - distance).abs()), bound, scene_depth),
                    };
                vpls.push(vpl);
            }
        }
        let scale = if counted > 0.0 { counted_flux / counted } else { 0.0 };
        for vpl in &mut vpls {
            vpl.intensity = (vpl.intensity.as_dvec3() * scale).as_vec3();
        }
        let (lattice_flux, counted_flux) = (emitted * scale, counted * scale);
        Wavefront { vpls, scene_depth, mean_albedo, later_albedo, light_flux: total, lattice_flux, counted_flux }
    }

    /// The share of reflected light that is reflected once more. Of what a surface sends out, as much is taken to
    /// leave the scene as of the lattice's rays.
    fn later_albedo(&self, albedo: Vec3, light_flux: Vec3, probe: &LightProbe) -> f32 {
        let stays: f32 = self
            .rays
            .iter()
            .zip(&probe.rays)
            .filter(|(_, (hit, _))| hit.is_some())
            .map(|(ray, _)| ray.solid_angle)
            .sum();
        let albedo = albedo.dot(light_flux) / light_flux.element_sum().max(f32::MIN_POSITIVE);
        (albedo * stays / (2.0 * PI)).clamp(0.0, MAX_MEAN_ALBEDO)
    }
}

/// The share of a VPL's flux that reaches surfaces although it gets no brighter below the distance `bound`; all in m.
///
/// In front (two thirds of the flux) it stands before a plane across its ray at distance `ahead`: the integral of
/// `cos / max(d, bound)²` over the plane is that of `cos / d²` times x (2 − x), x = ahead / bound up to 1. Behind (one
/// third) it looks into a sphere of which `depth` is the diameter, from its wall: 1 − ⅔ · bound / depth.
fn received(ahead: Option<f32>, bound: f32, depth: f32) -> f64 {
    let share = |part: f32, whole: f32| if part < whole { f64::from(part / whole) } else { 1.0 };
    let x = ahead.map_or(1.0, |ahead| share(ahead, bound));
    let behind = 1.0 - 2.0 / 3.0 * share(bound, depth);
    2.0 / 3.0 * x * (2.0 - x) + behind / 3.0
}

/// ρ̄: the albedo at the rays' ends, weighted with the flux that the light sends there.
fn mean_albedo(beam: &[f64], probe: &LightProbe, light_flux: Vec3) -> f32 {
    let flux = light_flux.as_dvec3();
    let reflected: f64 =
        beam.iter().zip(&probe.rays).map(|(&weight, (_, albedo))| weight * flux.dot(albedo.as_dvec3())).sum();
    let sent = beam.iter().sum::<f64>() * flux.element_sum();
    if sent > 0.0 { ((reflected / sent) as f32).clamp(0.0, MAX_MEAN_ALBEDO) } else { 0.0 }
}

impl Wave {
    /// VPLs of the whole lattice: rays times shells.
    pub fn vpls(&self) -> u32 {
        let times = |step: f32, whole: f32| (whole / step).round() as u32;
        (times(self.delta_theta, 90.0) * times(self.delta_phi, 360.0) + 1) * self.shells
    }
}

/// Refuses steps that do not divide 90° and 360°; the message names the nearest that do.
pub fn check_steps(wave: &Wave) -> Result<()> {
    steps("wave.delta_theta", wave.delta_theta, 90.0)?;
    steps("wave.delta_phi", wave.delta_phi, 360.0)?;
    Ok(())
}

/// How often `step` goes into `whole` degrees.
fn steps(key: &str, step: f32, whole: f32) -> Result<u32> {
    let count = f64::from(whole) / f64::from(step);
    let rounded = count.round().max(1.0);
    // f32 holds a step to 6e-8 of itself; a thousandth of a degree over the whole circle is far below a cell.
    if (f64::from(step) * rounded - f64::from(whole)).abs() <= 1e-3 {
        return Ok(rounded as u32);
    }
    let [below, above] = [count.ceil(), count.floor().max(1.0)].map(|n| (f64::from(whole) / n * 1e6).round() / 1e6);
    Err(Error::Setting {
        key: key.to_owned(),
        problem: format!("{step} does not divide {whole} degrees"),
        allowed: format!("the nearest that do are {below} and {above}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    fn light(profile: Profile) -> Light {
        Light {
            name: String::new(),
            position: Vec3::new(1.0, 2.0, 3.0),
            axis: Vec3::new(0.48, -0.6, 0.64),
            intensity: Vec3::new(3.0, 2.0, 1.0),
            profile,
        }
    }

    /// Everything around the light is at 4 m but for the first ray (2 m) and the second (nothing); the farthest is 5 m.
    fn probe(lattice: &Lattice, albedo: Vec3) -> LightProbe {
        let mut rays = vec![(Some(4.0), albedo); lattice.rays.len()];
        rays[0].0 = Some(2.0);
        rays[1].0 = None;
        LightProbe { scene_depth: Some(5.0), rays }
    }

    fn wavefront(wave: &Wave, profile: Profile, albedo: Vec3) -> Wavefront {
        let lattice = Lattice::new(wave).unwrap();
        let light = light(profile);
        let frame = Lattice::frame(&light, Vec3::ZERO, 3.0);
        lattice.wavefront(wave, 1.0, &light, &surroundings(frame, &probe(&lattice, albedo)))
    }

    /// Surfaces of albedo 0.6, and a bound of 0.3 of the depth.
    fn surroundings(frame: (Vec3, Mat3), probe: &LightProbe) -> Surroundings<'_> {
        Surroundings { frame, radius: 3.0, albedo: Vec3::splat(0.6), d_min: 0.3, probe }
    }

    #[test]
    fn thesis_lattice_has_1297_rays_5_shells_6485_vpls() {
        let wave = Settings::preset("thesis").unwrap().wave;
        let lattice = Lattice::new(&wave).unwrap();
        assert_eq!((lattice.rays.len(), lattice.shells.len()), (18 * 72 + 1, 5));
        assert_eq!(wavefront(&wave, Profile::Cosine, Vec3::splat(0.5)).vpls.len(), 6485);
        let shares: Vec<f32> = lattice.shells.iter().map(|shell| shell.distance).collect();
        assert_eq!(shares, [0.05, 0.1, 0.2, 0.4, 0.8]);
        assert!(lattice.shells.iter().all(|shell| shell.attenuation == shell.distance));
    }

    #[test]
    fn rays_stand_at_their_angles_and_cells_tile_the_hemisphere() {
        for (delta_theta, delta_phi) in [(5.0, 5.0), (7.5, 22.5), (90.0, 360.0), (30.0, 0.5)] {
            let wave = Wave { delta_theta, delta_phi, ..Wave::default() };
            let lattice = Lattice::new(&wave).unwrap();
            let (rings, sectors) = ((90.0 / delta_theta) as usize, (360.0 / delta_phi) as usize);
            assert_eq!(lattice.rays.len(), rings * sectors + 1);
            for (i, ray) in lattice.rays.iter().enumerate() {
                let (ring, sector) = if i == 0 { (0, 0) } else { ((i - 1) / sectors + 1, (i - 1) % sectors) };
                let theta = f64::from(delta_theta).to_radians() * ring as f64;
                let phi = f64::from(delta_phi).to_radians() * sector as f64;
                let expected = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
                for (a, b) in ray.direction_ls.to_array().into_iter().zip(expected) {
                    assert!((f64::from(a) - b).abs() < 1e-6, "ray {i}: {} {expected:?}", ray.direction_ls);
                }
            }
            let sum: f64 = lattice.rays.iter().map(|ray| f64::from(ray.solid_angle)).sum();
            assert!((sum / std::f64::consts::TAU - 1.0).abs() < 1e-5, "{sum}");
        }
    }

    #[test]
    fn distances_follow_the_depth_mode() {
        let wave = Settings::preset("thesis").unwrap().wave;
        let center = light(Profile::Cosine).position;
        for (depth, expected) in [(Depth::Scene, [5.0, 5.0, 5.0]), (Depth::Ray, [2.0, 5.0, 4.0])] {
            let front = wavefront(&Wave { depth, ..wave.clone() }, Profile::Cosine, Vec3::splat(0.5));
            for (ray, expected) in [0, 1, 2].into_iter().zip(expected) {
                for (s, share) in [0.05, 0.1, 0.2, 0.4, 0.8].into_iter().enumerate() {
                    let vpl = front.vpls[ray * 5 + s];
                    assert!(((vpl.position - center).length() - expected * share).abs() < 1e-5);
                    assert!((vpl.position - center).normalize().dot(vpl.direction) > 0.99999);
                }
            }
            assert!(front.vpls.iter().all(|v| v.direction.dot(light(Profile::Cosine).axis) > -1e-6));
        }
    }

    #[test]
    fn flux_is_that_of_the_energy_rule_for_every_choice() {
        let albedo = Vec3::new(0.8, 0.4, 0.2);
        let spot = Profile::Spot { inner: 0.3, outer: 0.6 };
        for profile in [Profile::Uniform, Profile::Cosine, spot, Profile::Point, Profile::Directional] {
            for weighting in [Weighting::Uniform, Weighting::SolidAngle] {
                for tint in [Tint::None, Tint::Surface] {
                    for attenuation in [Attenuation::Absorbed, Attenuation::Transmitted] {
                        let energy = Energy::Emitted;
                        let wave = Wave { weighting, tint, attenuation, energy, ..Wave::default() };
                        let front = wavefront(&wave, profile, albedo);
                        let light = light(profile).flux(3.0);
                        let mean = light.dot(albedo) / light.element_sum();
                        assert!((front.mean_albedo - mean).abs() < 1e-5, "{profile:?}: {}", front.mean_albedo);
                        let rule = f64::from(light.element_sum() * mean / (1.0 - mean));
                        let flux: f64 = front.vpls.iter().map(|v| f64::from(v.flux().element_sum())).sum();
                        assert!((flux / rule - 1.0).abs() < 1e-4, "{profile:?} {weighting:?} {tint:?}: {flux} {rule}");
                        assert!((front.lattice_flux / rule - 1.0).abs() < 1e-4);

                        // What the bound takes away is put back, and light goes on with the albedo of the scene but
                        // for what leaves through the one ray that meets nothing.
                        let front = wavefront(&Wave { energy: Energy::Received, ..wave }, profile, albedo);
                        let lattice = Lattice::new(&Wave::default()).unwrap();
                        let later = 0.6 * (1.0 - lattice.rays[1].solid_angle / (2.0 * PI));
                        assert!((front.later_albedo - later).abs() < 1e-5, "{}", front.later_albedo);
                        let rule = f64::from(light.element_sum() * mean / (1.0 - later));
                        let received: f64 = (front.vpls.iter().enumerate())
                            .map(|(i, v)| {
                                let along = (v.position - self::light(profile).position).length();
                                let hit = [2.0, f32::INFINITY, 4.0][(i / 5).min(2)];
                                let along = if profile == Profile::Directional { f32::NAN } else { along };
                                let x = f64::from((hit - along).abs() / 1.5).min(1.0);
                                f64::from(v.flux().element_sum()) * (2.0 * x * (2.0 - x) + 0.8) / 3.0
                            })
                            .sum();
                        if profile != Profile::Directional {
                            assert!((received / rule - 1.0).abs() < 1e-4, "{profile:?}: {received} {rule}");
                        }
                        assert!((front.counted_flux / rule - 1.0).abs() < 1e-4);
                    }
                }
            }
        }
    }

    /// The closed forms of `received` against sums over the plane and over the sphere.
    #[test]
    fn what_the_bound_lets_arrive_is_the_integral_over_the_surface() {
        for (ahead, bound, depth) in [(0.3f64, 1.5f64, 5.0f64), (1.2, 1.5, 2.0), (2.0, 1.5, 9.0)] {
            let steps = 200_000;
            // Rings on the plane by their direction: the plane's share of the solid angle is cos / d² da.
            let plane: f64 = (0..steps)
                .map(|i| {
                    let cosine = (f64::from(i) + 0.5) / f64::from(steps);
                    (ahead / cosine / bound).min(1.0).powi(2)
                })
                .sum();
            // In the sphere, a ray at that cosine to the normal is a chord of depth · cos.
            let sphere: f64 =
                (0..steps).map(|i| (depth * (f64::from(i) + 0.5) / f64::from(steps) / bound).min(1.0).powi(2)).sum();
            let expected = (2.0 * plane + sphere) / 3.0 / f64::from(steps);
            let got = received(Some(ahead as f32), bound as f32, depth as f32);
            assert!((got - expected).abs() < 1e-4, "{ahead} {bound} {depth}: {got} {expected}");
        }
        assert!((received(None, 0.0, 5.0) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn attenuation_is_what_is_lost_or_what_is_kept() {
        for (attenuation, kept) in [
            (Attenuation::Absorbed, [0.95, 0.9, 0.8, 0.6, 0.2]),
            (Attenuation::Transmitted, [0.05, 0.1, 0.2, 0.4, 0.8]),
        ] {
            let front = wavefront(&Wave { attenuation, ..Wave::default() }, Profile::Cosine, Vec3::splat(0.5));
            for s in 0..5 {
                let ratio = front.vpls[5 + s].intensity.x / front.vpls[5].intensity.x;
                assert!((ratio - kept[s] / kept[0]).abs() < 1e-5 * ratio, "{attenuation:?} shell {s}: {ratio}");
            }
        }
    }

    #[test]
    fn a_spots_cone_is_the_profile() {
        let outer = 32f32.to_radians();
        let profile = Profile::Spot { inner: 0.2, outer };
        let lattice = Lattice::new(&Wave::default()).unwrap();
        for (weighting, beyond) in [(Weighting::SolidAngle, false), (Weighting::Uniform, true)] {
            let wave = Wave { weighting, tint: Tint::None, ..Wave::default() };
            let front = wavefront(&wave, profile, Vec3::splat(0.5));
            for (ray, vpls) in lattice.rays.iter().zip(front.vpls.chunks(5)) {
                let carries = vpls.iter().all(|v| v.intensity.x > 0.0);
                assert_eq!(carries, beyond || ray.theta < outer, "{weighting:?} at {}", ray.theta.to_degrees());
            }
        }
    }

    #[test]
    fn a_light_that_sees_nothing_or_black_gives_dark_vpls() {
        let front = wavefront(&Wave::default(), Profile::Cosine, Vec3::ZERO);
        assert!(front.lattice_flux == 0.0 && front.vpls.iter().all(|v| v.intensity == Vec3::ZERO));
        let lattice = Lattice::new(&Wave::default()).unwrap();
        let light = light(Profile::Cosine);
        let frame = Lattice::frame(&light, Vec3::ZERO, 3.0);
        let front = lattice.wavefront(&Wave::default(), 1.0, &light, &surroundings(frame, &LightProbe::default()));
        assert!(front.vpls.len() == 6485 && front.vpls.iter().all(|v| v.position.is_finite()));
        assert_eq!((front.scene_depth, front.mean_albedo), (3.0, 0.0));
    }

    #[test]
    fn white_surroundings_stay_finite() {
        let front = wavefront(&Wave::default(), Profile::Cosine, Vec3::ONE);
        assert_eq!(front.mean_albedo, MAX_MEAN_ALBEDO);
        assert!(front.vpls.iter().all(|v| v.intensity.is_finite()));
    }
}
