//! The frame: scene → shadow map of the light → VPLs → their visibility → G-buffer → direct light → gather →
//! composite → tone map.

use std::rc::Rc;
use std::time::Instant;

use glam::{Vec2, Vec3};

use crate::frame::{Layer, PassTime, Progress, RenderOptions, Rendered, Stats};
use crate::gl::{Context, DriverInfo, Timer};
use crate::lattice::{Lattice, Surroundings, Vpl, Wavefront};
use crate::passes::{
    Ao, Composite, Direct, FrameBlock, GBuffer, Gather, GpuScene, Ism, LatticeProbe, LightLayers, PlaneShadow, Shadow,
    ShadowMaps, Tonemap, VplTexture, VplVisibility,
};
use crate::reference::{Emitters, Surfaces, gather};
use crate::reflected::{MOST_HITS, ReflectedWave, Tracer};
use crate::scene::Bounds;
use crate::settings::{Model, Settings, Visibility};
use crate::surfel::Surfels;
use crate::{Error, Light, Profile, Result, Scene, sampling};

/// Draws scenes on a context. Every picture uploads its scene and compiles its programs anew.
pub struct Renderer {
    context: Rc<Context>,
}

impl Renderer {
    /// Takes the context on which everything is drawn.
    pub fn new(context: Rc<Context>) -> Result<Self> {
        Ok(Self { context })
    }

    /// Whether the driver can draw such a picture with such settings, but for its memory; fails as
    /// [`Renderer::render`] would.
    pub fn check(&self, settings: &Settings, options: &RenderOptions) -> Result<()> {
        let info = self.context.info();
        check_size(info, options)?;
        settings.check()?;
        check_limits(info, settings)?;
        if settings.visibility.has_isms() && options.layer.has_indirect_light() {
            // As many as there can be, chance having its limits.
            let (all, fraction) = (vpl_count(settings) as f32, settings.wave.fraction);
            let vpls = all * fraction + 6.0 * (all * fraction * (1.0 - fraction)).sqrt();
            Ism::check(info, &settings.ism, vpls.min(all) as u32)?;
        }
        Ok(())
    }

    /// Renders a picture and waits for it. `progress` hears how far it has come.
    ///
    /// Fails with [`Error::Argument`] for a size that the driver cannot draw, with [`Error::Setting`] for settings
    /// that ask for more than it can hold, and with [`Error::Gl`] if it gives up.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &Settings,
        options: &RenderOptions,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Rendered> {
        progress(Progress { pass: "scene", fraction: 0.0 });
        let mut frame = Frame::new(&self.context, scene, settings, options)?;
        for number in 0..options.frames.max(1) {
            frame.run(number, progress)?;
        }
        frame.finish()
    }
}

/// What one picture needs, and what its passes have made so far.
pub(crate) struct Frame<'a> {
    context: Rc<Context>,
    scene: &'a Scene,
    settings: &'a Settings,
    options: &'a RenderOptions,
    bounds: Bounds,
    scene_albedo: Vec3,
    lattice: Lattice,
    gpu_scene: GpuScene,
    pub(crate) surfels: Option<Surfels>,
    surfaces: Option<Surfaces<'a>>,
    emitters: Emitters,
    emission_maps: Option<ShadowMaps>,
    pub(crate) gbuffer: GBuffer,
    shadow: Shadow,
    other_shadow: Option<Shadow>,
    plane_shadow: Option<PlaneShadow>,
    pub(crate) direct: Direct,
    probe: LatticeProbe,
    pub(crate) gather: Gather,
    pub(crate) ao: Option<Ao>,
    composite: Composite,
    tonemap: Tonemap,
    wavefront: Option<Wavefront>,
    reflected: Option<ReflectedWave>,
    pub(crate) vpls: Vec<Vpl>,
    vpl_texture: Option<VplTexture>,
    ism: Option<Ism>,
    shadow_maps: Option<ShadowMaps>,
    clock: Clock,
    begun: Instant,
    started: Instant,
}

impl<'a> Frame<'a> {
    /// Checks what was asked for, uploads the scene and makes the passes.
    pub fn new(
        context: &Rc<Context>,
        scene: &'a Scene,
        settings: &'a Settings,
        options: &'a RenderOptions,
    ) -> Result<Self> {
        let (width, height) = (options.width, options.height);
        check_size(context.info(), options)?;
        settings.check()?;
        check_limits(context.info(), settings)?;
        let started = Instant::now();
        let lights = &scene.lights;
        let is_parallel = |light: &Light| light.profile == Profile::Directional;
        let shadow_size = settings.shadow.size;
        // Other lights' maps are made one after the other in the same textures.
        let other_cube = lights.iter().skip(1).any(|light| !is_parallel(light));
        let indirect = options.layer.has_indirect_light();
        let surfels = (settings.visibility.has_isms() && indirect).then(|| Surfels::new(scene, settings.ism.surfels));
        let rays = settings.model == Model::Reflected || settings.visibility == Visibility::Mixed;
        Ok(Self {
            context: context.clone(),
            scene,
            settings,
            options,
            scene_albedo: scene.mean_albedo(),
            bounds: scene.bounds().unwrap_or(Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE }),
            lattice: Lattice::new(&settings.wave)?,
            gpu_scene: GpuScene::new(context, scene)?,
            surfels,
            surfaces: (rays && indirect).then(|| Surfaces::new(scene)),
            emitters: Emitters::new(scene),
            emission_maps: None,
            gbuffer: GBuffer::new(context, width, height).map_err(too_many_pixels(options))?,
            shadow: Shadow::new(context, shadow_size, true).map_err(too_large("shadow.size", shadow_size))?,
            other_shadow: other_cube.then(|| Shadow::new(context, shadow_size, false)).transpose()?,
            plane_shadow: lights.iter().any(is_parallel).then(|| PlaneShadow::new(context, shadow_size)).transpose()?,
            direct: Direct::new(context, width, height).map_err(too_many_pixels(options))?,
            probe: LatticeProbe::new(context)?,
            gather: Gather::new(context, settings, width, height).map_err(too_many_pixels(options))?,
            ao: if matches!(settings.visibility, Visibility::Ao | Visibility::Dao) || options.layer == Layer::Ao {
                Some(Ao::new(context, width, height)?)
            } else {
                None
            },
            composite: Composite::new(context, width, height).map_err(too_many_pixels(options))?,
            tonemap: Tonemap::new(context, width, height).map_err(too_many_pixels(options))?,
            wavefront: None,
            reflected: None,
            vpls: Vec::new(),
            vpl_texture: None,
            ism: None,
            shadow_maps: None,
            clock: Clock::default(),
            begun: started,
            started,
        })
    }

    /// One frame: the passes in order.
    pub fn run(&mut self, number: u32, progress: &mut dyn FnMut(Progress)) -> Result<()> {
        let frames = self.options.frames.max(1) as f32;
        let mut report = |pass, share: f32| {
            progress(Progress { pass, fraction: ((number as f32 + share) / frames).min(1.0) });
        };
        self.started = Instant::now();
        let camera = &self.options.camera;
        let far = self.bounds.farthest(camera.eye);
        let frame = FrameBlock::new(camera, self.options.width, self.options.height, far, jitter(number));
        let redraw = number == 0 || self.settings.wave.redraw;

        report("shadow", 0.0);
        if number == 0 {
            self.light_shadow()?;
            self.light_lattice()?;
            self.reflected_wave()?;
        }
        if redraw {
            self.draw_vpls(number)?;
            self.imperfect_shadow_maps(number, &mut |share| report("ism", 0.02 + 0.18 * share))?;
        }
        self.timed("gbuffer", |s| {
            s.gbuffer.run(&s.gpu_scene, &frame);
            Ok(())
        })?;
        report("direct", 0.2);
        self.ambient_occlusion(&frame)?;
        self.direct_light()?;
        self.direct_emission(number)?;
        if self.options.layer.has_indirect_light() {
            self.indirect_light(number, &mut |share| report("gather", 0.22 + 0.76 * share))?;
        }
        self.timed("composite", |s| {
            // For directional ambient occlusion the gather has done it.
            let dimmed = s.settings.visibility == Visibility::Ao || s.options.layer == Layer::Ao;
            let light = LightLayers {
                direct: s.direct.result().color(0),
                irradiance: s.gather.irradiance(),
                specular: s.gather.specular(),
                ambient: s.ao.as_ref().filter(|_| dimmed).map(Ao::ambient),
            };
            s.composite.run(&s.gbuffer, &light, s.options.layer, number);
            Ok(())
        })?;
        report("composite", 0.99);
        Ok(())
    }

    /// Shadow map of the primary light, as the lattice and the direct light read it.
    fn light_shadow(&mut self) -> Result<()> {
        let Some(light) = self.scene.lights.first() else { return Ok(()) };
        let (center, radius) = (self.bounds.center(), self.bounds.radius());
        let (origin, world_from_light) = Lattice::frame(light, center, radius);
        let far = map_range(&self.bounds, origin);
        let whole_sphere = light.profile == Profile::Point;
        self.timed("shadow", |s| {
            s.shadow.run(&s.gpu_scene, origin, world_from_light, far, whole_sphere);
            Ok(())
        })
    }

    /// The lattice around the primary light, with the depth that its shadow map holds.
    fn light_lattice(&mut self) -> Result<()> {
        let Some(light) = self.scene.lights.first() else { return Ok(()) };
        let (center, radius) = (self.bounds.center(), self.bounds.radius());
        self.timed("lattice", |s| {
            let probe = s.probe.run(&s.shadow, &s.lattice)?;
            let around = Lattice::frame(light, center, radius);
            let (wave, strength) = (&s.settings.wave, s.settings.strength);
            let d_min = s.settings.gather.d_min;
            let around = Surroundings { frame: around, radius, albedo: s.scene_albedo, d_min, probe: &probe };
            s.wavefront = Some(s.lattice.wavefront(wave, strength, light, &around));
            Ok(())
        })
    }

    /// The VPLs that light leaves where it is reflected, instead of those of the lattice.
    fn reflected_wave(&mut self) -> Result<()> {
        if self.tracer().is_none() {
            return Ok(());
        }
        self.timed("reflected", |s| {
            let wave = s.tracer().map(|tracer| tracer.run(&s.lattice, &s.scene.lights, s.settings.strength));
            s.reflected = wave;
            Ok(())
        })
    }

    /// What traces reflected waves, if they are asked for.
    fn tracer(&self) -> Option<Tracer<'_>> {
        let surfaces = self.surfaces.as_ref().filter(|_| self.settings.model == Model::Reflected)?;
        let (settings, seed) = (&self.settings.reflected, self.options.seed);
        Some(Tracer::new(surfaces, &self.emitters, self.bounds, &self.lattice, settings, seed))
    }

    /// The VPLs that are on in this frame, in their texture.
    fn draw_vpls(&mut self, number: u32) -> Result<()> {
        self.timed("vpl", |s| {
            let seed = s.options.seed;
            let all = match (&s.reflected, &s.wavefront) {
                (Some(wave), _) => &wave.vpls[..],
                (None, Some(front)) => &front.vpls,
                (None, None) => &[],
            };
            s.vpls = sampling::stochastic_fraction(all, s.settings.wave.fraction, seed, number);
            if s.settings.visibility == Visibility::ShadowMaps {
                s.vpls = sampling::by_power(&s.vpls, s.settings.shadow_maps.count, seed, number);
            }
            let mut vpls = std::mem::take(&mut s.vpls);
            if let Some(tracer) = s.tracer() {
                tracer.lay_patches(&mut vpls);
            }
            s.vpls = vpls;
            if let (Visibility::Mixed, Some(surfaces)) = (s.settings.visibility, &s.surfaces) {
                gather::most_important_first(&mut s.vpls, surfaces, s.options);
            }
            s.vpl_texture = Some(VplTexture::new(&s.context, &s.vpls)?);
            Ok(())
        })
    }

    /// Imperfect shadow maps of all active VPLs.
    fn imperfect_shadow_maps(&mut self, number: u32, report: &mut dyn FnMut(f32)) -> Result<()> {
        let Some(surfels) = &self.surfels else { return Ok(()) };
        let count = self.vpls.len();
        if self.ism.as_ref().is_none_or(|ism| (ism.capacity as usize) < count) {
            let in_world = surfels.in_world(self.scene);
            let settings = &self.settings.ism;
            let ism = Ism::new(&self.context, settings, &in_world, surfels.area, count as u32);
            self.ism = Some(ism.map_err(too_large("ism.size", settings.size))?);
        }
        let far = self.vpl_range();
        self.timed("ism", |s| {
            if let (Some(ism), Some(vpls)) = (&s.ism, &s.vpl_texture) {
                let (context, mut drawn) = (&s.context, 0);
                let mut done = |count: u32| {
                    // Lets the report be true; a display would not wait here.
                    context.finish();
                    drawn += count;
                    report(drawn as f32 / vpls.count.max(1) as f32);
                };
                let seed = sampling::hash(number ^ sampling::hash(s.options.seed));
                ism.run(&s.settings.ism, vpls, s.mapped(vpls), far, seed, &mut done);
            }
            Ok(())
        })
    }

    /// All lights, each through its own shadow map.
    fn direct_light(&mut self) -> Result<()> {
        let (center, radius) = (self.bounds.center(), self.bounds.radius());
        self.timed("direct", |s| {
            let filter = s.settings.shadow.filter;
            s.direct.clear();
            for (i, light) in s.scene.lights.iter().enumerate() {
                if light.profile == Profile::Directional {
                    if let Some(map) = &mut s.plane_shadow {
                        map.run(&s.gpu_scene, light.axis, center, radius);
                        s.direct.add_parallel(&s.gbuffer, light, map, filter);
                    }
                } else if i == 0 {
                    s.direct.add(&s.gbuffer, light, &s.shadow, filter);
                } else if let Some(map) = &mut s.other_shadow {
                    let (origin, world_from_light) = Lattice::frame(light, center, radius);
                    let far = map_range(&s.bounds, origin);
                    map.run(&s.gpu_scene, origin, world_from_light, far, light.profile == Profile::Point);
                    s.direct.add(&s.gbuffer, light, map, filter);
                }
            }
            Ok(())
        })
    }

    /// Emissive surfaces, through points of them that have shadow maps; other points in every frame.
    fn direct_emission(&mut self, number: u32) -> Result<()> {
        if self.emitters.flux() <= 0.0 {
            return Ok(());
        }
        let settings = &self.settings.shadow_maps;
        let samples = self.settings.emission.samples;
        if self.emission_maps.is_none() {
            let maps = ShadowMaps::new(&self.context, settings, samples);
            self.emission_maps = Some(maps.map_err(too_large("shadow_maps.memory", settings.memory))?);
        }
        self.timed("emission", |s| {
            let seed = sampling::hash(number ^ sampling::hash(s.options.seed ^ 0x68e3_1da4));
            let vpls = s.emitters.vpls(s.scene, samples, seed);
            let texture = VplTexture::new(&s.context, &vpls)?;
            let far = s.farthest(&vpls);
            let Some(maps) = &s.emission_maps else { return Ok(()) };
            for first in (0..texture.count).step_by(maps.batch as usize) {
                let range = first..texture.count.min(first + maps.batch);
                maps.run(&s.gpu_scene, &vpls[range.start as usize..range.end as usize], far);
                s.direct.add_emission(&s.gbuffer, &texture, range, maps, far);
            }
            Ok(())
        })
    }

    /// What stands near each pixel, for those visibilities that ask.
    fn ambient_occlusion(&mut self, frame: &FrameBlock) -> Result<()> {
        if self.ao.is_none() {
            return Ok(());
        }
        let radius = self.settings.ao.radius * self.depth();
        self.timed("ao", |s| {
            if let Some(ao) = &s.ao {
                ao.run(&s.gbuffer, frame, radius);
            }
            Ok(())
        })
    }

    /// How many of the VPLs, the first ones, have shadow maps.
    fn mapped(&self, vpls: &VplTexture) -> u32 {
        match self.settings.visibility {
            Visibility::ShadowMaps => vpls.count,
            Visibility::Mixed => vpls.count.min(self.settings.shadow_maps.count),
            _ => 0,
        }
    }

    /// The sum over the active VPLs.
    fn indirect_light(&mut self, number: u32, report: &mut dyn FnMut(f32)) -> Result<()> {
        let far = self.vpl_range();
        if self.settings.visibility.has_shadow_maps() && self.shadow_maps.is_none() {
            let settings = &self.settings.shadow_maps;
            let maps = ShadowMaps::new(&self.context, settings, settings.count);
            self.shadow_maps = Some(maps.map_err(too_large("shadow_maps.memory", settings.memory))?);
        }
        self.timed("gather", |s| {
            s.gather.clear(number);
            let Some(vpls) = &s.vpl_texture else { return Ok(()) };
            let mut summed = 0;
            let context = &s.context;
            let mut done = |count: u32| {
                // Lets the report be true; a display would not wait here.
                context.finish();
                summed += count;
                report(summed as f32 / vpls.count.max(1) as f32);
            };
            let mapped = s.mapped(vpls);
            if let Some(maps) = &s.shadow_maps {
                for first in (0..mapped).step_by(maps.batch as usize) {
                    let range = first..mapped.min(first + maps.batch);
                    maps.run(&s.gpu_scene, &s.vpls[range.start as usize..range.end as usize], far);
                    let visibility = VplVisibility::ShadowMaps(maps, far);
                    s.gather.add(&s.gbuffer, vpls, range, visibility, &mut done);
                }
            }
            let visibility = match (s.settings.visibility, &s.ism, &s.ao) {
                (_, Some(ism), _) => VplVisibility::Ism(ism, far),
                (Visibility::Dao, _, Some(ao)) => VplVisibility::Dao(ao),
                _ => VplVisibility::None,
            };
            s.gather.add(&s.gbuffer, vpls, mapped..vpls.count, visibility, &mut done);
            Ok(())
        })?;
        self.timed("reconstruct", |s| {
            s.gather.reconstruct(&s.gbuffer);
            Ok(())
        })
    }

    /// Tone maps, reads the picture back and adds the numbers up.
    pub fn finish(mut self) -> Result<Rendered> {
        let options = self.options;
        let far = self.bounds.farthest(options.camera.eye).max(f32::MIN_POSITIVE);
        let mut exposure_ev = 0.0;
        self.timed("tonemap", |s| {
            let value = s.composite.result().color(0);
            exposure_ev = s.tonemap.run(value, options.layer, options.exposure, far);
            Ok(())
        })?;
        let linear = self.composite.result().read::<[f32; 4]>(0);
        let display = self.tonemap.result().read::<[u8; 4]>(0);
        self.context.check("reading the picture back")?;
        let frame_ms = self.started.elapsed().as_secs_f64() * 1e3;
        let passes = self.clock.read();
        let gpu_ms = passes.iter().map(|pass| pass.gpu_ms).sum::<Option<f64>>();
        let info = self.context.info();
        let (front, wave) = (self.wavefront.as_ref(), self.reflected.as_ref());
        let scene_depth = front.map_or(0.0, |front| front.scene_depth);
        Ok(Rendered {
            width: options.width,
            height: options.height,
            linear: from_the_top(&linear, options.width).map(|[r, g, b, _]| [r, g, b]).collect(),
            display: from_the_top(&display, options.width).collect(),
            stats: Stats {
                driver: info.renderer.clone(),
                version: info.version.clone(),
                scene: self.scene.name.clone(),
                size: [options.width, options.height],
                frames: options.frames.max(1),
                seed: options.seed,
                model: self.settings.model.name(),
                visibility: self.settings.visibility.name(),
                rays: self.lattice.rays.len(),
                shells: self.settings.wave.shells,
                vpls: self.all_vpls(),
                active_vpls: self.vpls.len(),
                scene_depth_m: scene_depth,
                shell_distances_m: self.lattice.shells.iter().map(|s| s.distance * scene_depth).collect(),
                attenuation: self.lattice.shells.iter().map(|s| s.attenuation).collect(),
                mean_albedo: front.map_or(0.0, |front| front.mean_albedo),
                later_albedo: front.map_or(0.0, |front| front.later_albedo),
                light_flux_w: wave.map_or(front.map_or(0.0, |front| front.light_flux), |wave| wave.light_flux),
                lattice_flux_w: wave.map_or(front.map_or(0.0, |front| front.lattice_flux), ReflectedWave::flux),
                lights: self.scene.lights.len(),
                surfels: self.surfels.as_ref().map_or(0, |surfels| surfels.list.len()),
                ism_tile: if self.surfels.is_some() { self.settings.ism.size } else { 0 },
                triangles: self.scene.triangle_count(),
                exposure_ev,
                passes,
                gpu_ms,
                frame_ms,
                total_ms: self.begun.elapsed().as_secs_f64() * 1e3,
            },
            vpls: self.vpls,
        })
    }

    /// VPLs before any are left out.
    fn all_vpls(&self) -> usize {
        let lattice = self.lattice.rays.len() * self.lattice.shells.len();
        self.reflected.as_ref().map_or(lattice, |wave| wave.vpls.len())
    }

    /// Depth of the scene as the light sees it, m; its size where there is no light.
    pub(crate) fn depth(&self) -> f32 {
        self.wavefront.as_ref().map_or(self.bounds.radius(), |front| front.scene_depth)
    }

    /// The farthest that a surface can be from a VPL, m.
    pub(crate) fn vpl_range(&self) -> f32 {
        self.farthest(&self.vpls)
    }

    fn farthest(&self, vpls: &[Vpl]) -> f32 {
        vpls.iter().map(|vpl| map_range(&self.bounds, vpl.position)).fold(f32::MIN_POSITIVE, f32::max)
    }

    /// Runs a pass, times it and asks the driver whether it liked it.
    fn timed(&mut self, name: &'static str, pass: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        let (begun, timer) = (Instant::now(), Timer::start(&self.context));
        let result = pass(self);
        timer.stop();
        self.clock.record(name, timer, begun.elapsed().as_secs_f64() * 1e3);
        result.and(self.context.check(name))
    }
}

/// Times of the passes.
#[derive(Default)]
struct Clock {
    passes: Vec<(&'static str, Timer, f64)>,
}

impl Clock {
    /// The last time of a pass counts: some run in the first frame alone.
    fn record(&mut self, name: &'static str, timer: Timer, cpu_ms: f64) {
        match self.passes.iter_mut().find(|pass| pass.0 == name) {
            Some(pass) => *pass = (name, timer, cpu_ms),
            None => self.passes.push((name, timer, cpu_ms)),
        }
    }

    fn read(&self) -> Vec<PassTime> {
        self.passes
            .iter()
            .map(|(name, timer, cpu_ms)| PassTime { name, gpu_ms: timer.wait_ms(), cpu_ms: *cpu_ms })
            .collect()
    }
}

/// Names the size of the picture when the driver has no memory for it.
fn too_many_pixels(options: &RenderOptions) -> impl FnOnce(Error) -> Error {
    move |error| match error {
        Error::Gl(problem) if problem.contains("out of memory") => Error::Argument {
            what: "size",
            problem: format!("{}x{} is more than the driver can hold ({problem})", options.width, options.height),
            allowed: "a smaller picture".to_owned(),
        },
        other => other,
    }
}

/// Names the setting when the driver has no memory for what it asks for.
fn too_large(key: &'static str, value: u32) -> impl FnOnce(Error) -> Error {
    move |error| match error {
        Error::Gl(problem) => Error::Setting {
            key: key.to_owned(),
            problem: format!("{value} is more than the driver can hold ({problem})"),
            allowed: "a smaller value".to_owned(),
        },
        other => other,
    }
}

/// Refuses pictures that are larger than the driver can draw.
fn check_size(info: &DriverInfo, options: &RenderOptions) -> Result<()> {
    let (width, height) = (options.width, options.height);
    let limit = info.max_viewport.map(|edge| edge.min(info.max_texture_size));
    if width == 0 || height == 0 || width > limit[0] || height > limit[1] {
        return Err(Error::Argument {
            what: "size",
            problem: format!("{width}x{height} cannot be drawn"),
            allowed: format!("1x1 to {}x{} on this driver", limit[0], limit[1]),
        });
    }
    Ok(())
}

/// VPLs that there are at most.
fn vpl_count(settings: &Settings) -> u32 {
    match settings.model {
        Model::Wave => settings.wave.vpls(),
        Model::Reflected => settings.wave.vpls() / settings.wave.shells * settings.reflected.bounces,
    }
}

/// Refuses settings that ask for larger textures than the driver has.
fn check_limits(info: &DriverInfo, settings: &Settings) -> Result<()> {
    let limit = info.max_texture_size;
    let vpls = vpl_count(settings);
    let many = match settings.model {
        Model::Wave => ("wave.shells", settings.wave.shells),
        Model::Reflected => ("reflected.bounces", settings.reflected.bounces),
    };
    let hits = u64::from(vpls) * u64::from(settings.reflected.rays);
    if settings.model == Model::Reflected && hits > MOST_HITS {
        return Err(Error::Setting {
            key: "reflected.rays".to_owned(),
            problem: format!("{} for each of {vpls} VPLs are too many", settings.reflected.rays),
            allowed: format!("{MOST_HITS} rays in all: fewer rays, bounces, or a coarser lattice"),
        });
    }
    for (key, value, needed, limit) in [
        ("shadow.size", settings.shadow.size, settings.shadow.size, limit.min(info.max_cube_size)),
        ("shadow_maps.size", settings.shadow_maps.size, 3 * settings.shadow_maps.size, limit),
        ("ism.surfels", settings.ism.surfels, settings.ism.surfels.div_ceil(512), limit),
        (many.0, many.1, vpls.div_ceil(512), limit),
    ] {
        if needed > limit {
            return Err(Error::Setting {
                key: key.to_owned(),
                problem: format!("{value} needs a texture of {needed} texels"),
                allowed: format!("textures up to {limit} texels on this driver"),
            });
        }
    }
    Ok(())
}

/// Distance that a map around `origin` must hold, m; a little more than the farthest point, never 0.
fn map_range(bounds: &Bounds, origin: Vec3) -> f32 {
    (bounds.farthest(origin) * 1.01).max(f32::MIN_POSITIVE)
}

/// Where a frame samples the pixel, in pixels from its centre: the first in the centre, the others spread over it.
fn jitter(number: u32) -> Vec2 {
    if number == 0 {
        return Vec2::ZERO;
    }
    let sample = sobol_burley::sample_4d(number & 0xffff, 0, number >> 16);
    Vec2::new(sample[0], sample[1]) - 0.5
}

/// Pixels whose first row is at the bottom, as OpenGL has them, from the top row on.
fn from_the_top<T: Copy>(pixels: &[T], width: u32) -> impl Iterator<Item = T> {
    pixels.chunks_exact(width as usize).rev().flatten().copied()
}
