//! The frame: scene → shadow map of the light → G-buffer → direct light → VPLs → their visibility → gather →
//! composite → tone map.

use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use glam::{Mat4, Vec2, Vec3};

use crate::frame::{DebugView, Exposure, Layer, PassTime, Progress, Rebuilds, RenderOptions, Rendered, Shown, Stats};
#[cfg(debug_assertions)]
use crate::gl::Program;
use crate::gl::{Context, Texture, Timer};
use crate::lattice::{Lattice, Surroundings, Vpl, Wavefront};
use crate::limits::{self, too_large, too_many_pixels};
use crate::passes::{
    Ao, Change, Composite, Debug, Direct, FrameBlock, GBuffer, Gather, GpuScene, Ism, LatticeProbe, LightLayers,
    PlaneShadow, Shadow, ShadowMaps, Tonemap, VplTexture, VplVisibility, motion,
};
use crate::patches::Exchange;
use crate::reference::{Emitters, Surfaces, Tree, gather};
use crate::reflected::{ReflectedWave, Tracer};
use crate::scene::Bounds;
use crate::settings::{self, GatherMethod, Model, Settings, Visibility};
#[cfg(debug_assertions)]
use crate::shaders::{self, Texts};
use crate::surfel::Surfels;
use crate::{Camera, Light, Profile, Result, Scene, sampling};

/// Draws scenes on a context. Other code may draw on it between the calls: it finds no framebuffer, program, vertex
/// array or sampler of ours bound, and its errors are not ours. A renderer keeps what it has uploaded and compiled, and
/// between the frames of [`Renderer::draw`] all that it has made of what did not change.
pub struct Renderer {
    context: Rc<Context>,
    pub(crate) frame: Option<Frame>,
    budget: Option<u32>,
    /// Whether VPLs stay as they are.
    held: bool,
    /// The VPL that lights alone.
    only: Option<u32>,
}

impl Renderer {
    /// Takes the context on which everything is drawn.
    pub fn new(context: Rc<Context>) -> Result<Self> {
        Ok(Self { context, frame: None, budget: None, held: false, only: None })
    }

    /// Bounds how many surface samples a frame of [`Renderer::draw`] splats into imperfect shadow maps, about: the maps of
    /// a new set of VPLs are made in as many frames as that takes, and until then the VPLs that have none throw no
    /// shadows. Where there is no GPU a frame would take seconds otherwise. `None`, as it is at first: all in one frame.
    pub fn set_ism_budget(&mut self, samples: Option<u32>) {
        self.budget = samples;
    }

    /// Whether the driver can draw such a picture with such settings, but for its memory; fails as
    /// [`Renderer::render`] would.
    pub fn check(&self, settings: &Settings, options: &RenderOptions) -> Result<()> {
        limits::check(self.context.info(), settings, options)?;
        limits::check_isms(self.context.info(), settings, options)
    }

    /// Renders a picture and waits for it: the mean of `options.frames` frames, the same whatever was drawn before.
    /// `progress` hears how far it has come.
    ///
    /// Fails with [`Error::Argument`](crate::Error::Argument) for a size that the driver cannot draw, with
    /// [`Error::Setting`](crate::Error::Setting) for settings that ask for more than it can hold, and with
    /// [`Error::Gl`](crate::Error::Gl) if it gives up.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &Settings,
        options: &RenderOptions,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Rendered> {
        progress(Progress { pass: "scene", fraction: 0.0 });
        let _turn = self.context.turn();
        let mut frame = self.take_frame(scene, settings, options)?;
        frame.budget = None;
        frame.begin();
        for number in 0..options.frames.max(1) {
            frame.run(number, options.frames.max(1), true, Some(progress))?;
        }
        let rendered = frame.finish()?;
        self.frame = Some(frame);
        Ok(rendered)
    }

    /// Draws one frame of an animation: makes anew only what differs from the frame before, and does not wait for
    /// the GPU. The number of frames in `options` has no meaning here. Fails as [`Renderer::render`] does.
    pub fn draw(&mut self, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Result<()> {
        let _turn = self.context.turn();
        let mut frame = self.take_frame(scene, settings, options)?;
        frame.budget = self.budget;
        frame.run(0, 1, false, None)?;
        self.frame = Some(frame);
        Ok(())
    }

    /// What a display shows of the frame that [`Renderer::draw`] drew last, without waiting for the GPU; `None` before
    /// the first.
    pub fn show(&mut self) -> Result<Option<Shown>> {
        let _turn = self.context.turn();
        self.frame.as_mut().map(Frame::show).transpose()
    }

    /// An intermediate of the frame that was drawn last, scaled to fit into so many pixels, without waiting for the GPU;
    /// `None` if there is no such thing. It has a texture of its own; for the rest it is as [`Renderer::show`].
    pub fn show_debug(&mut self, view: DebugView, width: u32, height: u32) -> Result<Option<Shown>> {
        let _turn = self.context.turn();
        let shown = self.frame.as_mut().map(|frame| frame.show_debug(view, [width, height])).transpose();
        shown.map(Option::flatten)
    }

    /// While they are held, the VPLs, their flux and the maps of what they see stay as they are, whatever lights, things
    /// and the camera do, in all frames that follow; direct light goes on. If there are none yet, in another scene or with
    /// other settings, they are made first. Shadow maps of more VPLs than there is memory for, and what the screen shows
    /// to `dao`, are of each frame all the same.
    pub fn hold_vpls(&mut self, hold: bool) {
        self.held = hold;
    }

    /// The VPL with that index in [`Renderer::vpls`] alone lights the frames that follow, all their pixels as the exact
    /// gather does; none if there is no such VPL. All do again with `None`.
    pub fn only_vpl(&mut self, index: Option<u32>) {
        self.only = index;
    }

    /// Times of the passes of a frame whose GPU times are there by now, in order: the latest, once. Does not wait.
    pub fn late_pass_times(&mut self) -> Option<Vec<PassTime>> {
        self.frame.as_mut().and_then(|frame| frame.clock.late())
    }

    /// The VPLs that light the last frame.
    pub fn vpls(&self) -> &[Vpl] {
        self.frame.as_ref().map_or(&[], |frame| &frame.vpls)
    }

    /// VPLs before any are left out, as [`Stats::vpls`] has them.
    pub fn all_vpls(&self) -> usize {
        self.frame.as_ref().map_or(0, Frame::all_vpls)
    }

    /// Share of the frames of a still view after which it changes no more, 0…1.
    pub fn converged(&self) -> f32 {
        self.frame.as_ref().map_or(0.0, |frame| match frame.settled {
            true => 1.0,
            false => (frame.still.0 as f32 / frame.frames_to_settle().max(1) as f32).min(1.0),
        })
    }

    /// Share of the imperfect shadow maps of a new set of VPLs that are made, with [`Renderer::set_ism_budget`].
    pub fn isms_made(&self) -> f32 {
        let coming = self.frame.as_ref().and_then(|frame| frame.coming_isms);
        coming.map_or(1.0, |(part, parts)| part as f32 / parts as f32)
    }

    /// What was made since the first frame.
    pub fn rebuilds(&self) -> Rebuilds {
        self.frame.as_ref().map_or_else(Rebuilds::default, |frame| frame.rebuilds)
    }

    /// Reads the shaders anew from the source folder of this crate, in debug builds: the next frame is drawn with them,
    /// from the start. If a file is missing or does not compile, the old ones stay, and the error names file and line.
    #[cfg(debug_assertions)]
    pub fn reload_shaders(&mut self) -> Result<()> {
        self.read_shaders(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders")))
    }

    /// Takes the shaders in a folder, if all programs can be made of them.
    #[cfg(debug_assertions)]
    pub(crate) fn read_shaders(&mut self, folder: &std::path::Path) -> Result<()> {
        let _turn = self.context.turn();
        let before = self.context.shaders.replace(Texts::read(folder)?);
        let computes = if self.context.info().compute { shaders::COMPUTE_PROGRAMS } else { &[] };
        // Of some programs it shows only later that they are needed.
        let mut sources = shaders::PROGRAMS.iter().chain(computes);
        let made = sources.try_for_each(|source| Program::new(&self.context, source).map(drop));
        match made {
            Ok(()) => self.frame = None,
            Err(_) => drop(self.context.shaders.replace(before)),
        }
        made
    }

    /// The context.
    pub fn context(&self) -> &Rc<Context> {
        &self.context
    }

    /// The frame that [`Renderer::draw`] drew last; waits for it. `None` before the first.
    pub fn read(&mut self) -> Result<Option<Rendered>> {
        let _turn = self.context.turn();
        self.frame.as_mut().map(Frame::finish).transpose()
    }

    /// Times of the passes that ran in the last frame, in order; waits for the GPU.
    pub fn pass_times(&self) -> Vec<PassTime> {
        self.frame.as_ref().map_or_else(Vec::new, |frame| frame.clock.read(frame.clock.frame))
    }

    /// Waits until everything is drawn.
    pub fn wait(&self) {
        self.context.finish();
    }

    /// What was kept, brought up to date; gone if that fails.
    fn take_frame(&mut self, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Result<Frame> {
        let mut frame = match self.frame.take() {
            Some(frame) => frame,
            None => Frame::new(&self.context, scene, settings, options)?,
        };
        frame.held = self.held;
        frame.update(scene, settings, options, self.only)?;
        Ok(frame)
    }
}

/// What rises with every change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Versions {
    /// Shapes, materials and where the instances stand.
    surfaces: u64,
    lights: u64,
    /// Where the VPLs stand.
    places: u64,
    /// Where they stand and what they send out.
    vpls: u64,
}

impl Versions {
    /// What is between the VPLs and the surfaces.
    fn between(self) -> Self {
        Self { lights: 0, vpls: 0, ..self }
    }
}

/// What the VPLs depend on.
#[derive(Clone, PartialEq)]
struct VplKey {
    versions: Versions,
    settings: (Model, Visibility, GatherMethod, f32, f32, u32),
    /// Whether their light shows.
    indirect: bool,
    wave: settings::Wave,
    reflected: settings::Reflected,
    seed: u32,
    drawn: u32,
    /// Where importance depends on it.
    view: Option<(Camera, [u32; 2])>,
}

/// What a frame showed.
#[derive(PartialEq)]
struct Last {
    /// As bytes, which compare.
    frame: Vec<u8>,
    versions: Versions,
    settings: Rc<Settings>,
    layer: Layer,
}

/// What things were made of: they are made again when that is something else.
#[derive(Default)]
struct Made {
    surfels: Option<u32>,
    tree: Option<u64>,
    shadow: Option<(u64, Light)>,
    lattice: Option<VplKey>,
    vpls: Option<VplKey>,
    ism: Option<(Versions, settings::Ism, u32)>,
    cubes: Vec<Option<(u64, Light)>>,
    planes: Vec<Option<(u64, Light)>>,
    emission: Option<(u64, settings::ShadowMaps, u32, [u32; 2])>,
    emission_maps: Option<u32>,
    shadow_maps: Option<(Versions, u32)>,
}

/// Takes note of what something is made of; whether that is new.
fn renew<K: PartialEq>(slot: &mut Option<K>, key: K) -> bool {
    let new = slot.as_ref() != Some(&key);
    *slot = Some(key);
    new
}

/// Frames that the mean is of at most while VPLs change.
const RELIT: u32 = 4;

/// Means over frames begin anew where all VPLs together become so many times as bright in a frame.
const BRIGHTER: f32 = 4.0;

/// Frames that the mean counts for at most when the view comes to rest.
const RESTED: u32 = 16;

/// The gather of a picture alone goes on until each pixel has summed so many VPLs.
const ENOUGH: u32 = 400;

/// Sums that are shared for each subset of the VPLs where they are of the subsets by chance.
const UNEVEN: f32 = 4.0;

/// Turns of all subsets of the VPLs after which a still view is finished, though the view moved before: at least so many,
/// and so many where the mean of before counts as much as it can.
const SETTLED: (u32, u32) = (2, 4);

/// Memory for the shadow maps of all lights but the first, bytes; with more lights than that holds, some share.
const LIGHT_MAPS: u64 = 512 << 20;

/// What frames need, and what their passes have made so far.
pub(crate) struct Frame {
    context: Rc<Context>,
    scene: Rc<Scene>,
    settings: Rc<Settings>,
    options: Rc<RenderOptions>,
    versions: Versions,
    made: Made,
    rebuilds: Rebuilds,
    /// Frames since [`Frame::begin`].
    turn: u32,
    /// Whether the last frame had nothing to add to the sum over the VPLs.
    settled: bool,
    /// See [`Renderer::hold_vpls`] and [`Renderer::only_vpl`].
    held: bool,
    only: Option<u32>,
    /// How the instances moved since the frame before, for the shader that goes back; and forth, empty if none did.
    motion: Option<Texture>,
    moved: Vec<Mat4>,
    /// The frame before, of those with indirect light whose means go on.
    last: Option<Last>,
    /// The last frame of all, and whether it was the same as the one before.
    picture: Option<Last>,
    same: bool,
    /// Frames that show the same, up to and with the last one, and whether there was no frame before them.
    still: (u32, bool),
    bounds: Bounds,
    scene_albedo: Vec3,
    lattice: Lattice,
    gpu_scene: GpuScene,
    pub(crate) surfels: Option<Surfels>,
    tree: Option<Arc<Tree>>,
    emitters: Emitters,
    emission: Option<(Vec<Vpl>, VplTexture)>,
    emission_maps: Option<ShadowMaps>,
    pub(crate) gbuffer: GBuffer,
    shadow: Shadow,
    cubes: Vec<Shadow>,
    planes: Vec<PlaneShadow>,
    pub(crate) direct: Direct,
    probe: LatticeProbe,
    pub(crate) gather: Gather,
    pub(crate) ao: Option<Ao>,
    composite: Composite,
    tonemap: Tonemap,
    debug: Option<Debug>,
    wavefront: Option<Wavefront>,
    reflected: Option<ReflectedWave>,
    pub(crate) vpls: Vec<Vpl>,
    vpl_texture: Option<VplTexture>,
    exchange: Exchange,
    /// Instance on which each VPL of reflected waves stands.
    owners: Vec<Option<usize>>,
    /// The farthest that a surface can be from a VPL, m.
    far: f32,
    /// Parts of the flux of each VPL, W. Which part is made anew next, of the flux and of the ISMs, and how many of them
    /// are of lights and surfaces that have changed since.
    fluxes: Vec<Vec<Vec3>>,
    next: u32,
    stale: u32,
    stale_isms: u32,
    /// How much brighter all VPLs together are than in the last frame that summed them.
    brightening: Vec3,
    /// Surface samples that a frame splats, and of a new set of ISMs the next part and how many there are.
    budget: Option<u32>,
    coming_isms: Option<(u32, u32)>,
    pub(crate) ism: Option<Ism>,
    shadow_maps: Option<ShadowMaps>,
    clock: Clock,
    begun: Instant,
    started: Instant,
}

impl Frame {
    /// Checks what was asked for, uploads the scene and makes the passes.
    pub fn new(context: &Rc<Context>, scene: &Scene, settings: &Settings, options: &RenderOptions) -> Result<Self> {
        let (width, height) = (options.width, options.height);
        limits::check(context.info(), settings, options)?;
        let started = Instant::now();
        let shadow_size = settings.shadow.size;
        let mut frame = Self {
            context: context.clone(),
            scene: Rc::new(scene.clone()),
            settings: Rc::new(settings.clone()),
            options: Rc::new(options.clone()),
            versions: Versions::default(),
            made: Made::default(),
            rebuilds: Rebuilds { scene: 1, ..Rebuilds::default() },
            turn: 0,
            settled: false,
            held: false,
            only: None,
            motion: None,
            moved: Vec::new(),
            last: None,
            picture: None,
            same: false,
            still: (0, true),
            scene_albedo: scene.mean_albedo(),
            bounds: bounds(scene),
            lattice: Lattice::new(&settings.wave)?,
            gpu_scene: GpuScene::new(context, scene)?,
            surfels: None,
            tree: None,
            emitters: Emitters::new(scene),
            emission: None,
            emission_maps: None,
            gbuffer: GBuffer::new(context, width, height).map_err(too_many_pixels(options))?,
            shadow: Shadow::new(context, shadow_size, true).map_err(too_large("shadow.size", shadow_size))?,
            cubes: Vec::new(),
            planes: Vec::new(),
            direct: Direct::new(context, width, height).map_err(too_many_pixels(options))?,
            probe: LatticeProbe::new(context)?,
            gather: Gather::new(context, settings, width, height).map_err(too_many_pixels(options))?,
            ao: None,
            composite: Composite::new(context, width, height).map_err(too_many_pixels(options))?,
            tonemap: Tonemap::new(context, width, height).map_err(too_many_pixels(options))?,
            debug: None,
            wavefront: None,
            reflected: None,
            vpls: Vec::new(),
            vpl_texture: None,
            exchange: Exchange::default(),
            owners: Vec::new(),
            far: f32::MIN_POSITIVE,
            fluxes: Vec::new(),
            next: 0,
            stale: 0,
            stale_isms: 0,
            brightening: Vec3::ONE,
            budget: None,
            coming_isms: None,
            ism: None,
            shadow_maps: None,
            clock: Clock::default(),
            begun: started,
            started,
        };
        frame.light_maps()?;
        frame.ambient_occlusion_pass()?;
        Ok(frame)
    }

    /// Takes up what the next frame shall show. What depends on a difference is made anew when its turn comes.
    pub fn update(
        &mut self,
        scene: &Scene,
        settings: &Settings,
        options: &RenderOptions,
        only: Option<u32>,
    ) -> Result<()> {
        let context = self.context.clone();
        let (was, before) = (self.settings.clone(), self.options.clone());
        limits::check(context.info(), settings, options)?;
        let (width, height) = (options.width, options.height);
        let resized = (width, height) != (before.width, before.height);
        let before_scene = self.scene.clone();
        let deformed = deformed_meshes(&self.scene, scene);
        let reshaped = deformed.as_ref().is_none_or(|meshes| !meshes.is_empty());
        let moved = self.scene.instances != scene.instances;
        let relit = self.scene.lights != scene.lights;
        if reshaped || moved || relit || self.scene.name != scene.name {
            self.scene = Rc::new(scene.clone());
        }
        self.settings = Rc::new(settings.clone());
        self.options = Rc::new(options.clone());
        match &deformed {
            None => {
                self.gpu_scene = GpuScene::new(&context, scene)?;
                self.rebuilds.scene += 1;
                // VPLs are held in one scene.
                (self.made.surfels, self.made.vpls) = (None, None);
                self.tree = None;
            }
            Some(meshes) if reshaped => {
                self.gpu_scene.deform(scene, meshes)?;
                if let Some(surfels) = &mut self.surfels {
                    surfels.deform(scene, meshes);
                }
            }
            Some(_) if moved => self.gpu_scene.place(scene)?,
            Some(_) => {}
        }
        if moved && deformed.is_some() {
            let pairs = scene.instances.iter().zip(&before_scene.instances);
            let back: Vec<Mat4> = pairs
                .map(|(now, then)| match now == then {
                    true => Mat4::IDENTITY,
                    false => then.world_from_object * now.world_from_object.inverse(),
                })
                .collect();
            self.motion = Some(motion(&context, &back)?);
            // VPLs do not follow a surface that deforms.
            self.moved = if reshaped { Vec::new() } else { back.iter().map(Mat4::inverse).collect() };
        }
        if reshaped || moved {
            self.versions.surfaces += 1;
            self.bounds = bounds(scene);
            self.scene_albedo = scene.mean_albedo();
            self.emitters = Emitters::new(scene);
        }
        self.versions.lights += u64::from(relit);
        if resized {
            self.gbuffer = GBuffer::new(&context, width, height).map_err(too_many_pixels(options))?;
            self.direct = Direct::new(&context, width, height).map_err(too_many_pixels(options))?;
            self.composite = Composite::new(&context, width, height).map_err(too_many_pixels(options))?;
            self.tonemap.resize(width, height).map_err(too_many_pixels(options))?;
            self.ao = None;
        }
        let (sums_before, sums) = (sums(&was, self.only), sums(settings, only));
        // Other subsets of the same VPLs have the same mean.
        let grouped = |s: &Settings| (s.gather.interleave, s.gather.most);
        let mut ungrouped = sums.clone();
        (ungrouped.gather.interleave, ungrouped.gather.most) = grouped(&sums_before);
        let regrouped = sums_before == ungrouped
            && !resized
            && (grouped(&sums_before) == grouped(&sums) || self.gather.regroup(&sums)?);
        let gathers = |s: &Settings| (s.visibility, s.gather.clone(), s.model, s.sums_specular(), s.tier);
        if resized || (!regrouped && gathers(&sums_before) != gathers(&sums)) {
            self.gather = Gather::new(&context, &sums, width, height).map_err(too_many_pixels(options))?;
        }
        if resized || !regrouped || only != self.only {
            // Means of what the old settings made are no beginning for those of the new.
            self.last = None;
        }
        self.only = only;
        if was.tier != settings.tier {
            (self.ism, self.made.ism) = (None, None);
        }
        if was.wave != settings.wave {
            self.lattice = Lattice::new(&settings.wave)?;
        }
        let size = settings.shadow.size;
        if was.shadow.size != size {
            self.shadow = Shadow::new(&context, size, true).map_err(too_large("shadow.size", size))?;
            (self.cubes, self.planes) = (Vec::new(), Vec::new());
            (self.made.shadow, self.made.cubes, self.made.planes) = (None, Vec::new(), Vec::new());
        }
        if was.shadow_maps != settings.shadow_maps || was.visibility != settings.visibility {
            (self.shadow_maps, self.made.shadow_maps) = (None, None);
        }
        if was.shadow_maps != settings.shadow_maps || was.emission != settings.emission {
            (self.emission_maps, self.made.emission_maps) = (None, None);
        }
        self.light_maps()?;
        self.ambient_occlusion_pass()
    }

    /// From here on as if nothing had been drawn before, but for what is uploaded and compiled.
    pub fn begin(&mut self) {
        self.made =
            Made { cubes: vec![None; self.cubes.len()], planes: vec![None; self.planes.len()], ..Made::default() };
        self.rebuilds = Rebuilds { scene: self.rebuilds.scene, ..Rebuilds::default() };
        self.clock = Clock::default();
        self.turn = 0;
        self.coming_isms = None;
        self.last = None;
        self.begun = Instant::now();
    }

    /// Shadow maps for all lights but what the first one has anyway.
    fn light_maps(&mut self) -> Result<()> {
        let size = self.settings.shadow.size;
        let is_parallel = |light: &&Light| light.profile == Profile::Directional;
        let parallel = self.scene.lights.iter().filter(is_parallel).count();
        let others = self.scene.lights.iter().skip(1).filter(|light| !is_parallel(light)).count();
        let texels = u64::from(size).pow(2) * 4;
        let fitting = |count: usize, bytes: u64| count.min((LIGHT_MAPS / bytes).max(1) as usize);
        let (cubes, planes) = (fitting(others, 6 * texels), fitting(parallel, texels));
        self.cubes.truncate(cubes);
        self.planes.truncate(planes);
        while self.cubes.len() < cubes {
            self.cubes.push(Shadow::new(&self.context, size, false).map_err(too_large("shadow.size", size))?);
        }
        while self.planes.len() < planes {
            self.planes.push(PlaneShadow::new(&self.context, size).map_err(too_large("shadow.size", size))?);
        }
        self.made.cubes.resize(cubes, None);
        self.made.planes.resize(planes, None);
        Ok(())
    }

    fn ambient_occlusion_pass(&mut self) -> Result<()> {
        let (settings, options) = (&self.settings, &self.options);
        let needed = matches!(settings.visibility, Visibility::Ao | Visibility::Dao) || options.layer == Layer::Ao;
        if !needed {
            self.ao = None;
        } else if self.ao.is_none() {
            self.ao = Some(Ao::new(&self.context, options.width, options.height)?);
        }
        Ok(())
    }

    /// One frame: the passes in order. `sample` counts the `samples` frames that are averaged, from 0. For a picture
    /// `alone`, which has no frames before it, the gather takes more turns.
    pub fn run(
        &mut self,
        sample: u32,
        samples: u32,
        alone: bool,
        mut progress: Option<&mut dyn FnMut(Progress)>,
    ) -> Result<()> {
        let options = self.options.clone();
        // Waiting lets a report be true; a display does not wait.
        let context = self.context.clone();
        let mut report = |pass, share: f32| {
            if let Some(progress) = &mut progress {
                context.finish();
                progress(Progress { pass, fraction: ((sample as f32 + share) / samples as f32).min(1.0) });
            }
        };
        self.started = Instant::now();
        self.clock.next_frame();
        self.settled = !options.layer.has_indirect_light();
        let camera = &options.camera;
        let far = self.bounds.farthest(camera.eye);
        let frame = FrameBlock::new(camera, options.width, options.height, far, jitter(sample));
        let picture = self.as_last(&frame);
        let before = self.picture.replace(picture);
        self.same = before == self.picture;

        report("shadow", 0.0);
        self.light_shadow()?;
        self.timed("gbuffer", |s| {
            s.gbuffer.run(&s.gpu_scene, &frame);
            Ok(())
        })?;
        report("direct", 0.01);
        self.direct_light()?;
        self.direct_emission(sample)?;
        // The GPU has that to do while the CPU traces rays.
        self.context.flush();
        if self.rests() {
            // They are there when their light shows again.
        } else if !self.holds() {
            self.light_lattice()?;
            self.draw_vpls()?;
            self.imperfect_shadow_maps(&mut |share| report("ism", 0.03 + 0.18 * share))?;
        } else if options.layer.has_indirect_light() {
            self.next_isms()?;
        }
        self.ambient_occlusion(&frame)?;
        if options.layer.has_indirect_light() {
            let (vpls, subsets) = (self.vpls.len().max(1) as u32, self.subsets());
            let enough = (ENOUGH * subsets).div_ceil(vpls).clamp(1, subsets);
            let turns = if alone && self.settings.gather.history > 1 { enough } else { 1 };
            for turn in 0..turns {
                let share = |share: f32| 0.22 + 0.76 * (turn as f32 + share) / turns as f32;
                self.indirect_light(&frame, samples, &mut |part| report("gather", share(part)))?;
            }
        }
        self.timed("composite", |s| {
            // For directional ambient occlusion the gather has done it.
            let dimmed = s.settings.visibility == Visibility::Ao || options.layer == Layer::Ao;
            let light = LightLayers {
                direct: s.direct.result().color(0),
                irradiance: s.gather.irradiance(),
                specular: s.gather.specular(),
                ambient: s.ao.as_ref().filter(|_| dimmed).map(Ao::ambient),
            };
            s.composite.run(&s.gbuffer, &light, options.layer, sample);
            Ok(())
        })?;
        report("composite", 0.99);
        (self.motion, self.moved) = (None, Vec::new());
        Ok(())
    }

    /// Shadow map of the primary light, as the lattice and the direct light read it.
    fn light_shadow(&mut self) -> Result<()> {
        let scene = self.scene.clone();
        let Some(light) = scene.lights.first() else { return Ok(()) };
        if !renew(&mut self.made.shadow, (self.versions.surfaces, light.clone())) {
            return Ok(());
        }
        let (center, radius) = (self.bounds.center(), self.bounds.radius());
        let (origin, world_from_light) = Lattice::frame(light, center, radius);
        let far = map_range(&self.bounds, origin);
        let whole_sphere = light.profile == Profile::Point;
        self.rebuilds.shadow_maps += 1;
        self.timed("shadow", |s| {
            s.shadow.run(&s.gpu_scene, origin, world_from_light, far, whole_sphere);
            Ok(())
        })
    }

    /// What all VPLs depend on, before some are chosen: with `drawn` and `view` 0 and none.
    fn vpl_key(&self) -> VplKey {
        let s = &self.settings;
        VplKey {
            versions: Versions { places: 0, vpls: 0, ..self.versions },
            settings: (s.model, s.visibility, s.gather.method, s.strength, s.gather.d_min, s.shadow_maps.count),
            indirect: self.options.layer.has_indirect_light(),
            wave: s.wave.clone(),
            reflected: s.reflected.clone(),
            seed: self.options.seed,
            drawn: 0,
            view: None,
        }
    }

    /// Whether there are VPLs whose light does not show now, and would be the same.
    fn rests(&self) -> bool {
        let now = VplKey { indirect: true, ..self.vpl_key() };
        !self.options.layer.has_indirect_light() && self.made.lattice.as_ref() == Some(&now)
    }

    /// Whether there are VPLs that are held: made with the same settings, if they show.
    fn holds(&self) -> bool {
        let Some(made) = self.made.vpls.as_ref().filter(|_| self.held) else { return false };
        let now = self.vpl_key();
        let same = *made == VplKey { versions: made.versions, drawn: made.drawn, view: made.view.clone(), ..now };
        let has_maps = self.made.ism.as_ref().is_some_and(|(_, ism, _)| *ism == self.settings.ism);
        !self.options.layer.has_indirect_light() || (same && (has_maps || !self.settings.visibility.has_isms()))
    }

    /// The lattice around the primary light, with the depth that its shadow map holds, and the waves that surfaces
    /// reflect, if they are asked for.
    fn light_lattice(&mut self) -> Result<()> {
        let key = self.vpl_key();
        if self.made.lattice.as_ref() == Some(&key) {
            return self.relight();
        }
        if self.follow(&key)? {
            return self.relight();
        }
        self.made.lattice = Some(key);
        (self.stale, self.stale_isms, self.fluxes) = (0, 0, Vec::new());
        (self.wavefront, self.reflected, self.made.vpls) = (None, None, None);
        let scene = self.scene.clone();
        if let Some(light) = scene.lights.first() {
            let (center, radius) = (self.bounds.center(), self.bounds.radius());
            self.timed("lattice", |s| {
                let probe = s.probe.run(&s.shadow, &s.lattice)?;
                let around = Lattice::frame(light, center, radius);
                let (wave, strength) = (&s.settings.wave, s.settings.strength);
                let d_min = s.settings.gather.d_min;
                let around = Surroundings { frame: around, radius, albedo: s.scene_albedo, d_min, probe: &probe };
                s.wavefront = Some(s.lattice.wavefront(wave, strength, light, &around));
                Ok(())
            })?;
        }
        if self.settings.model != Model::Reflected || !self.options.layer.has_indirect_light() {
            return Ok(());
        }
        self.timed("reflected", |s| {
            let surfaces = Surfaces::with(&scene, s.tree());
            let wave = s.tracer(&surfaces).run(&s.lattice, &scene.lights, s.settings.strength);
            s.reflected = Some(wave);
            Ok(())
        })
    }

    /// Keeps the VPLs of the frame before, if of what they depend on only lights have changed, and where things stand, and
    /// if they are all that there are of reflected waves, in their order. They move with what they stand on.
    fn follow(&mut self, key: &VplKey) -> Result<bool> {
        let Some(made) = &self.made.lattice else { return Ok(false) };
        let (was, is) = (made.versions.surfaces, key.versions.surfaces);
        let moved = was + 1 == is && !self.moved.is_empty();
        let same = *made == VplKey { versions: made.versions, ..key.clone() };
        let all = self.settings.wave.fraction >= 1.0
            // Else those that are drawn again would be evened out again.
            && !self.settings.wave.redraw
            && !matches!(self.settings.visibility, Visibility::ShadowMaps | Visibility::Mixed);
        let reflected = self.settings.reflected.frames > 1 && self.reflected.is_some() && !self.vpls.is_empty();
        if !(same && all && reflected && (was == is || moved)) {
            return Ok(false);
        }
        if moved {
            let mut vpls = self.vpls.clone();
            for (vpl, owner) in vpls.iter_mut().zip(&self.owners) {
                if let Some(motion) = owner.map(|owner| self.moved[owner]) {
                    vpl.position = motion.transform_point3(vpl.position);
                    vpl.direction = motion.transform_vector3(vpl.direction).normalize_or(vpl.direction);
                }
            }
            // What the ISMs hold is measured by this distance.
            if self.farthest(&vpls) > self.far {
                return Ok(false);
            }
            self.vpl_texture = Some(self.texture_of(&vpls)?);
            self.vpls = vpls;
            // They may be next to each other no more.
            let owners = &self.owners;
            self.exchange.retain(|a, b| owners[a] == owners[b]);
            let before = self.versions.between();
            if let Some((versions, ..)) = &mut self.made.ism
                && *versions == (Versions { surfaces: was, ..before })
            {
                versions.surfaces = is;
                self.stale_isms = self.settings.reflected.frames;
                let scene = self.scene.clone();
                if let (Some(ism), Some(surfels)) = (&mut self.ism, &self.surfels) {
                    ism.place(&surfels.in_world(&scene))?;
                }
            }
        }
        self.stale = self.settings.reflected.frames;
        for made in [&mut self.made.lattice, &mut self.made.vpls].into_iter().flatten() {
            (made.versions.lights, made.versions.surfaces) = (key.versions.lights, is);
        }
        Ok(true)
    }

    /// Where lights or surfaces have changed, a part of the flux that VPLs send out is traced anew in each of some frames
    /// that follow (Laine et al. 2007 too have a budget for each frame).
    fn relight(&mut self) -> Result<()> {
        if self.stale == 0 {
            return Ok(());
        }
        let parts = self.settings.reflected.frames;
        self.stale -= 1;
        self.next = (self.next + 1) % parts;
        let scene = self.scene.clone();
        self.rebuilds.vpls += 1;
        self.versions.vpls += 1;
        self.timed("reflected", |s| {
            let strength = s.settings.strength;
            if s.fluxes.is_empty() {
                let share = 1.0 / (parts as f32 * strength.max(f32::MIN_POSITIVE));
                s.fluxes = vec![s.vpls.iter().map(|vpl| vpl.flux() * share).collect(); parts as usize];
            }
            let surfaces = Surfaces::with(&scene, s.tree());
            let seed = sampling::hash(s.options.seed ^ sampling::hash(s.next ^ 0x3c6e_f372));
            let tracer = Tracer::new(&surfaces, &s.emitters, s.bounds, &s.lattice, &s.settings.reflected, seed);
            let (mut flux, light_flux) = tracer.relight(&s.lattice, &scene.lights, parts, &s.vpls);
            s.exchange.even_out(&mut flux);
            s.fluxes[s.next as usize] = flux.into_iter().map(|flux| flux / parts as f32).collect();
            let all = |vpls: &[Vpl]| -> Vec3 { vpls.iter().map(|vpl| vpl.intensity).sum() };
            let before = all(&s.vpls);
            for (i, vpl) in s.vpls.iter_mut().enumerate() {
                let flux: Vec3 = s.fluxes.iter().map(|part| part[i]).sum();
                vpl.intensity = flux * (strength / std::f32::consts::PI);
            }
            let after = all(&s.vpls);
            if after.cmpgt(before * BRIGHTER).any() {
                // What was nearly dark says nothing about what is seen now.
                s.last = None;
            } else {
                let scale = |c: usize| if before[c] > 0.0 { after[c] / before[c] } else { 1.0 };
                s.brightening *= Vec3::new(scale(0), scale(1), scale(2));
            }
            if let Some(wave) = &mut s.reflected {
                (wave.light_flux, wave.vpls) = (light_flux, s.vpls.clone());
            }
            match &mut s.vpl_texture {
                Some(texture) => texture.relight(&s.context, &s.vpls),
                None => Ok(()),
            }
        })
    }

    /// VPLs as the gather reads them, with the lists that it needs.
    fn texture_of(&self, vpls: &[Vpl]) -> Result<VplTexture> {
        let listed = self.settings.gather.method == GatherMethod::Interleaved;
        VplTexture::new(&self.context, vpls, listed.then_some(&self.bounds))
    }

    /// What rays need of the scene as it stands now.
    fn tree(&mut self) -> Arc<Tree> {
        let old = renew(&mut self.made.tree, self.versions.surfaces) && self.tree.is_some();
        let tree = self.tree.get_or_insert_with(|| Arc::new(Tree::new(&self.scene)));
        if old {
            Arc::make_mut(tree).follow(&self.scene);
        }
        tree.clone()
    }

    /// What traces reflected waves.
    fn tracer<'a>(&'a self, surfaces: &'a Surfaces) -> Tracer<'a> {
        Tracer::new(surfaces, &self.emitters, self.bounds, &self.lattice, &self.settings.reflected, self.options.seed)
    }

    /// The VPLs that are on in this frame, in their texture.
    fn draw_vpls(&mut self) -> Result<()> {
        let drawn = if self.settings.wave.redraw { self.turn } else { 0 };
        let size = [self.options.width, self.options.height];
        let important = self.settings.visibility == Visibility::Mixed && self.options.layer.has_indirect_light();
        let view = important.then(|| (self.options.camera.clone(), size));
        let key = VplKey { drawn, view, ..self.vpl_key() };
        if !renew(&mut self.made.vpls, key) {
            return Ok(());
        }
        self.rebuilds.vpls += 1;
        self.versions.places += 1;
        self.versions.vpls += 1;
        self.timed("vpl", |s| {
            let seed = s.options.seed;
            let all = match (&s.reflected, &s.wavefront) {
                (Some(wave), _) => &wave.vpls[..],
                (None, Some(front)) => &front.vpls,
                (None, None) => &[],
            };
            let mut vpls = sampling::stochastic_fraction(all, s.settings.wave.fraction, seed, drawn);
            if s.settings.visibility == Visibility::ShadowMaps {
                vpls = sampling::by_power(&vpls, s.settings.shadow_maps.count, seed, drawn);
            }
            if s.reflected.is_some() || important {
                let scene = s.scene.clone();
                let surfaces = Surfaces::with(&scene, s.tree());
                if s.reflected.is_some() {
                    let most = match s.settings.visibility {
                        Visibility::ShadowMaps => s.settings.shadow_maps.count,
                        _ => limits::vpl_count(&s.settings),
                    };
                    s.exchange = s.tracer(&surfaces).lay_patches(&mut vpls, most as usize);
                    let owner = |vpl: &Vpl| surfaces.closest(vpl.position, -vpl.direction, 0.0, false);
                    s.owners = vpls.iter().map(|vpl| owner(vpl).map(|(hit, _)| hit.instance)).collect();
                }
                if important {
                    gather::most_important_first(&mut vpls, &surfaces, &s.options);
                }
            }
            s.vpl_texture = Some(s.texture_of(&vpls)?);
            s.far = s.farthest(&vpls);
            s.vpls = vpls;
            Ok(())
        })
    }

    /// Imperfect shadow maps of all active VPLs.
    fn imperfect_shadow_maps(&mut self, report: &mut dyn FnMut(f32)) -> Result<()> {
        let settings = self.settings.clone();
        if !settings.visibility.has_isms() || !self.options.layer.has_indirect_light() {
            (self.ism, self.surfels) = (None, None);
            (self.made.ism, self.made.surfels, self.coming_isms) = (None, None, None);
            return Ok(());
        }
        let drawn = if settings.wave.redraw { self.turn } else { 0 };
        let before = self.made.ism.clone();
        let key = (self.versions.between(), settings.ism.clone(), drawn);
        if !renew(&mut self.made.ism, key) {
            return self.renew_isms();
        }
        let scene = self.scene.clone();
        let surfels_new = renew(&mut self.made.surfels, settings.ism.surfels);
        let surfels = match self.surfels.take().filter(|_| !surfels_new) {
            Some(surfels) => surfels,
            None => Surfels::new(&scene, settings.ism.surfels),
        };
        let count = self.vpls.len();
        let moved =
            before.is_none_or(|(versions, ism, _)| versions.surfaces != self.versions.surfaces || ism != settings.ism);
        if moved || surfels_new || self.ism.as_ref().is_none_or(|ism| (ism.capacity as usize) < count) {
            let in_world = surfels.in_world(&scene);
            // The old atlas goes first: there may not be room for both.
            self.ism = None;
            let computes = settings.tier.computes(self.context.info());
            let ism = Ism::new(&self.context, &settings.ism, computes, &in_world, surfels.area, count as u32);
            self.ism = Some(ism.map_err(too_large("ism.size", settings.ism.size))?);
        }
        self.surfels = Some(surfels);
        let far = self.vpl_range();
        self.rebuilds.isms += 1;
        let samples = u64::from(settings.ism.points) * count as u64;
        let parts = self.budget.map_or(1, |budget| samples.div_ceil(u64::from(budget.max(1))).clamp(1, 4096));
        self.coming_isms = (parts > 1).then_some((0, parts as u32));
        if self.coming_isms.is_some() {
            if let Some(ism) = &self.ism {
                ism.show_all();
            }
            return self.next_isms();
        }
        self.timed("ism", |s| {
            if let (Some(ism), Some(vpls)) = (&s.ism, &s.vpl_texture) {
                let mut made = 0;
                let mut done = |count: u32| {
                    made += count;
                    report(made as f32 / vpls.count.max(1) as f32);
                };
                let seed = sampling::hash(drawn ^ sampling::hash(s.options.seed));
                ism.run(&settings.ism, vpls, s.mapped(vpls)..vpls.count, far, seed, &mut done);
            }
            Ok(())
        })
    }

    /// The next part of a new set of ISMs.
    fn next_isms(&mut self) -> Result<()> {
        let Some((part, parts)) = self.coming_isms else { return Ok(()) };
        self.coming_isms = (part + 1 < parts).then_some((part + 1, parts));
        // Less light is seen.
        self.versions.vpls += 1;
        let (settings, far) = (self.settings.clone(), self.vpl_range());
        let drawn = if settings.wave.redraw { self.turn } else { 0 };
        self.timed("ism", |s| {
            if let (Some(ism), Some(vpls)) = (&s.ism, &s.vpl_texture) {
                let range = ism.part(part, parts);
                let range = range.start..range.end.min(vpls.count);
                let seed = sampling::hash(drawn ^ sampling::hash(s.options.seed));
                ism.run(&settings.ism, vpls, range, far, seed, &mut |_| ());
            }
            Ok(())
        })
    }

    /// Where things have moved, a part of the ISMs is made anew in each of some frames that follow.
    fn renew_isms(&mut self) -> Result<()> {
        if self.coming_isms.is_some() {
            return self.next_isms();
        }
        if self.stale_isms == 0 {
            return Ok(());
        }
        self.stale_isms -= 1;
        self.rebuilds.isms += u64::from(self.stale_isms == 0);
        // Other light is seen.
        self.versions.vpls += 1;
        let (settings, far) = (self.settings.clone(), self.vpl_range());
        self.timed("ism", |s| {
            if let (Some(ism), Some(vpls)) = (&s.ism, &s.vpl_texture) {
                let seed = sampling::hash(sampling::hash(s.options.seed));
                let range = ism.part(s.next, settings.reflected.frames);
                ism.run(&settings.ism, vpls, range, far, seed, &mut |_| ());
            }
            Ok(())
        })
    }

    /// All lights, each through its own shadow map.
    fn direct_light(&mut self) -> Result<()> {
        let (center, radius) = (self.bounds.center(), self.bounds.radius());
        let scene = self.scene.clone();
        self.timed("direct", |s| {
            let (filter, surfaces) = (s.settings.shadow.filter, s.versions.surfaces);
            s.direct.clear();
            let (mut cube, mut plane) = (0, 0);
            for (i, light) in scene.lights.iter().enumerate() {
                if light.profile == Profile::Directional {
                    let slot = plane % s.planes.len();
                    plane += 1;
                    if renew(&mut s.made.planes[slot], (surfaces, light.clone())) {
                        s.rebuilds.shadow_maps += 1;
                        s.planes[slot].run(&s.gpu_scene, light.axis, center, radius);
                    }
                    s.direct.add_parallel(&s.gbuffer, light, &s.planes[slot], filter);
                } else if i == 0 {
                    s.direct.add(&s.gbuffer, light, &s.shadow, filter);
                } else {
                    let slot = cube % s.cubes.len();
                    cube += 1;
                    if renew(&mut s.made.cubes[slot], (surfaces, light.clone())) {
                        let (origin, world_from_light) = Lattice::frame(light, center, radius);
                        let far = map_range(&s.bounds, origin);
                        let whole_sphere = light.profile == Profile::Point;
                        s.rebuilds.shadow_maps += 1;
                        s.cubes[slot].run(&s.gpu_scene, origin, world_from_light, far, whole_sphere);
                    }
                    s.direct.add(&s.gbuffer, light, &s.cubes[slot], filter);
                }
            }
            Ok(())
        })
    }

    /// Emissive surfaces, through points of them that have shadow maps; other points for every sample of the picture.
    fn direct_emission(&mut self, sample: u32) -> Result<()> {
        if self.emitters.flux() <= 0.0 {
            return Ok(());
        }
        let settings = self.settings.clone();
        let samples = settings.emission.samples;
        if self.emission_maps.is_none() {
            let maps = ShadowMaps::new(&self.context, &settings.shadow_maps, samples);
            self.emission_maps = Some(maps.map_err(too_large("shadow_maps.memory", settings.shadow_maps.memory))?);
        }
        let key = (self.versions.surfaces, settings.shadow_maps.clone(), samples, [sample, self.options.seed]);
        let new = renew(&mut self.made.emission, key);
        self.timed("emission", |s| {
            if new || s.emission.is_none() {
                let seed = sampling::hash(sample ^ sampling::hash(s.options.seed ^ 0x68e3_1da4));
                let vpls = s.emitters.vpls(&s.scene, samples, seed);
                let texture = VplTexture::new(&s.context, &vpls, None)?;
                (s.emission, s.made.emission_maps) = (Some((vpls, texture)), None);
            }
            let (Some((vpls, texture)), Some(maps)) = (&s.emission, &s.emission_maps) else { return Ok(()) };
            let far = s.farthest(vpls);
            for first in (0..texture.count).step_by(maps.batch as usize) {
                let range = first..texture.count.min(first + maps.batch);
                if renew(&mut s.made.emission_maps, first) {
                    s.rebuilds.shadow_maps += u64::from(range.end - range.start);
                    maps.run(&s.gpu_scene, &vpls[range.start as usize..range.end as usize], far);
                }
                s.direct.add_emission(&s.gbuffer, texture, range, maps, far);
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

    /// What a frame shows, to compare.
    fn as_last(&self, frame: &FrameBlock) -> Last {
        let (settings, layer) = (self.settings.clone(), self.options.layer);
        Last { frame: bytemuck::bytes_of(frame).to_vec(), versions: self.versions, settings, layer }
    }

    /// Subsets of the VPLs that are on.
    fn subsets(&self) -> u32 {
        self.gather.subsets(self.vpls.len() as u32, self.settings.gather.most)
    }

    /// Frames of a still view after which every subset has had its turn as often as every other, and what was before has
    /// hardly any weight.
    fn frames_to_settle(&self) -> u32 {
        let subsets = self.subsets();
        // What was before weighs as much as a quarter of the subsets, or as so many frames.
        let turns =
            if self.still.1 { 1 } else { (4 * RESTED * SETTLED.1).div_ceil(subsets).clamp(SETTLED.0, SETTLED.1) };
        turns * subsets
    }

    /// The sum over the active VPLs.
    fn indirect_light(&mut self, frame: &FrameBlock, samples: u32, report: &mut dyn FnMut(f32)) -> Result<()> {
        let now = self.as_last(frame);
        let last = self.last.replace(now);
        let relit = last.as_ref().is_some_and(|last| last.versions.vpls != self.versions.vpls);
        let still = last == self.last;
        self.still = if still { (self.still.0 + 1, self.still.1) } else { (1, last.is_none()) };
        // Every subset has had its turn as often as every other, and what was before has no more weight.
        let subsets = self.subsets();
        if still && self.still.0 > self.frames_to_settle() {
            self.settled = self.coming_isms.is_none() && (self.held || (self.stale == 0 && self.stale_isms == 0));
            return Ok(());
        }
        let history = self.settings.gather.history;
        // The mean of pictures is taken later.
        let begins = last.is_none() || (samples > 1 && !still);
        let frames = match (begins, history, relit) {
            (true, ..) | (_, 1, _) => 0,
            (false, _, true) => history.min(RELIT) - 1,
            // What was seen from elsewhere has less weight once nothing moves.
            (false, _, false) if still && self.still.0 == 2 => history.min(RESTED).min(subsets / 4),
            (false, _, false) if still => u32::from(u16::MAX),
            (false, ..) => history - 1,
        };
        let far = self.vpl_range();
        let settings = self.settings.clone();
        if settings.visibility.has_shadow_maps() && self.shadow_maps.is_none() {
            let maps = ShadowMaps::new(&self.context, &settings.shadow_maps, settings.shadow_maps.count);
            self.shadow_maps = Some(maps.map_err(too_large("shadow_maps.memory", settings.shadow_maps.memory))?);
        }
        // Where the view moves it is left to chance which subsets come together.
        let (age, whole) = (self.still.0 as f32 / subsets as f32, self.still.1 || samples > 1);
        let share = if whole { 1.0 } else { UNEVEN + (1.0 - UNEVEN) * age.min(1.0) } / samples as f32;
        // Held VPLs see things where they were.
        let surfaces = self.made.vpls.as_ref().map_or(0, |made| made.versions.surfaces);
        let versions = Versions { surfaces, ..self.versions.between() };
        let scale = std::mem::replace(&mut self.brightening, Vec3::ONE);
        let change = Change { frame, motion: None, still, share, frames, scale };
        // What near VPLs give to a point is then what they gave before; other settings end the means, too. The lobe of one
        // that is near is wide, so that a few frames of the camera's way do not show. Horizons are those of the view.
        let same = last.as_ref().is_some_and(|last| last.versions == self.versions);
        let lasts = frames > 0 && same && self.settings.visibility != Visibility::Dao;
        self.timed("gather", |s| {
            s.gather.begin(s.turn, subsets, s.only, &change, lasts);
            let Some(vpls) = &s.vpl_texture else { return Ok(()) };
            let mut summed = 0;
            let mut done = |count: u32| {
                summed += count;
                report(summed as f32 / vpls.count.max(1) as f32);
            };
            let mapped = s.mapped(vpls);
            if let Some(maps) = &s.shadow_maps {
                for first in (0..mapped).step_by(maps.batch as usize) {
                    let range = first..mapped.min(first + maps.batch);
                    if renew(&mut s.made.shadow_maps, (versions, first)) {
                        s.rebuilds.shadow_maps += u64::from(range.end - range.start);
                        maps.run(&s.gpu_scene, &s.vpls[range.start as usize..range.end as usize], far);
                    }
                    let visibility = VplVisibility::ShadowMaps(maps, far);
                    s.gather.add(&s.gbuffer, vpls, range, visibility, &change, &mut done);
                }
            }
            let visibility = match (settings.visibility, &s.ism, &s.ao) {
                (_, Some(ism), _) => VplVisibility::Ism(ism, far),
                (Visibility::Dao, _, Some(ao)) => VplVisibility::Dao(ao),
                _ => VplVisibility::None,
            };
            s.gather.add(&s.gbuffer, vpls, mapped..vpls.count, visibility, &change, &mut done);
            Ok(())
        })?;
        self.timed("share", |s| {
            s.gather.share(&s.gbuffer, &Change { motion: s.motion.as_ref(), ..change });
            Ok(())
        })?;
        self.turn += 1;
        Ok(())
    }

    /// Tone maps.
    fn show(&mut self) -> Result<Shown> {
        let options = self.options.clone();
        let far = self.far_of_view();
        let (mut exposure_ev, mut settled) = (0.0, self.settled);
        self.timed("tonemap", |s| {
            let value = s.composite.result().color(0);
            (exposure_ev, settled) = match options.exposure {
                Exposure::Auto if options.layer.is_radiance() => {
                    let (ev, same) = s.tonemap.late_exposure(value, s.same && settled)?;
                    (ev, settled && same)
                }
                exposure => (s.tonemap.exposure(value, options.layer, exposure), settled),
            };
            s.tonemap.run(value, options.layer, exposure_ev, far);
            Ok(())
        })?;
        let texture = self.tonemap.result().color(0).native();
        Ok(Shown { texture, width: options.width, height: options.height, exposure_ev, settled })
    }

    /// Draws an intermediate, if there is one.
    pub(crate) fn show_debug(&mut self, view: DebugView, space: [u32; 2]) -> Result<Option<Shown>> {
        let indirect = self.options.layer.has_indirect_light();
        let mapped = self.vpl_texture.as_ref().map_or(0..0, |vpls| self.mapped(vpls)..vpls.count);
        let there = match view {
            DebugView::ShadowMap => self.made.shadow.is_some() && !self.scene.lights.is_empty(),
            DebugView::IsmAtlas => self.ism.is_some() && !mapped.is_empty(),
            DebugView::IsmTile(index) => self.ism.is_some() && mapped.contains(&index),
            DebugView::VplTexture => indirect && !self.vpls.is_empty(),
        };
        if !there {
            return Ok(None);
        }
        let mut debug = match self.debug.take() {
            Some(debug) => debug,
            None => Debug::new(&self.context)?,
        };
        self.timed("debug", |s| match (view, &s.ism, &s.vpl_texture) {
            (DebugView::IsmAtlas, Some(ism), _) => debug.isms(ism, None, mapped, space),
            (DebugView::IsmTile(index), Some(ism), _) => debug.isms(ism, Some(index), mapped, space),
            (DebugView::VplTexture, _, Some(texture)) => debug.vpls(texture, &s.vpls, &s.bounds, space),
            _ => debug.shadow_map(&s.shadow, space),
        })?;
        let target = debug.result();
        let (texture, width, height) = (target.color(0).native(), target.width, target.height);
        self.debug = Some(debug);
        Ok(Some(Shown { texture, width, height, exposure_ev: 0.0, settled: self.settled }))
    }

    /// Distance from the eye to the farthest point of the scene, m.
    fn far_of_view(&self) -> f32 {
        self.bounds.farthest(self.options.camera.eye).max(f32::MIN_POSITIVE)
    }

    /// Tone maps, reads the picture back and adds the numbers up.
    pub fn finish(&mut self) -> Result<Rendered> {
        let options = self.options.clone();
        let far = self.far_of_view();
        let mut exposure_ev = 0.0;
        self.timed("tonemap", |s| {
            let value = s.composite.result().color(0);
            exposure_ev = s.tonemap.exposure(value, options.layer, options.exposure);
            s.tonemap.run(value, options.layer, exposure_ev, far);
            Ok(())
        })?;
        let linear = self.composite.result().read::<[f32; 4]>(0);
        let display = self.tonemap.result().read::<[u8; 4]>(0);
        self.context.check("reading the picture back")?;
        let frame_ms = self.started.elapsed().as_secs_f64() * 1e3;
        let passes = self.clock.read(0);
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
                rebuilds: self.rebuilds,
                passes,
                gpu_ms,
                frame_ms,
                total_ms: self.begun.elapsed().as_secs_f64() * 1e3,
            },
            vpls: self.vpls.clone(),
        })
    }

    /// VPLs before any are left out.
    fn all_vpls(&self) -> usize {
        let lattice = self.lattice.rays.len() * self.lattice.shells.len();
        // Patches may have added some.
        self.reflected.as_ref().map_or(lattice, |wave| wave.vpls.len().max(self.vpls.len()))
    }

    /// Depth of the scene as the light sees it, m; its size where there is no light.
    pub(crate) fn depth(&self) -> f32 {
        self.wavefront.as_ref().map_or(self.bounds.radius(), |front| front.scene_depth)
    }

    /// The farthest that a surface can be from a VPL, m, as maps of the VPLs have it.
    pub(crate) fn vpl_range(&self) -> f32 {
        self.far
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
    /// Number of the frame, from 1.
    frame: u64,
    passes: Vec<Pass>,
    /// Passes of whole frames whose GPU times are not there yet, the oldest first.
    coming: VecDeque<Vec<Pass>>,
}

/// Frames whose times may be on their way; of more the oldest are forgotten.
const LATE_FRAMES: usize = 8;

/// A pass in the last frame in which it ran: some run in few frames, some more than once in each.
#[derive(Clone)]
struct Pass {
    name: &'static str,
    frame: u64,
    timers: Vec<Rc<Timer>>,
    cpu_ms: f64,
}

impl Pass {
    /// Waits for the GPU.
    fn time(&self) -> PassTime {
        let gpu_ms = self.timers.iter().map(|timer| timer.wait_ms()).sum();
        PassTime { name: self.name, gpu_ms, cpu_ms: self.cpu_ms }
    }
}

impl Clock {
    fn next_frame(&mut self) {
        let passes: Vec<Pass> = self.passes.iter().filter(|pass| pass.frame == self.frame).cloned().collect();
        if !passes.is_empty() {
            self.coming.push_back(passes);
        }
        while self.coming.len() > LATE_FRAMES {
            self.coming.pop_front();
        }
        self.frame += 1;
    }

    /// Times of the latest frame that are there, if they were not asked for before.
    fn late(&mut self) -> Option<Vec<PassTime>> {
        let is_there = |passes: &Vec<Pass>| passes.iter().flat_map(|pass| &pass.timers).all(|timer| timer.is_ready());
        let mut latest = None;
        while self.coming.front().is_some_and(is_there) {
            latest = self.coming.pop_front();
        }
        latest.map(|passes| passes.iter().map(Pass::time).collect())
    }

    fn record(&mut self, name: &'static str, timer: Timer, cpu_ms: f64) {
        let (frame, timer) = (self.frame, Rc::new(timer));
        match self.passes.iter_mut().find(|pass| pass.name == name) {
            Some(pass) if pass.frame == frame => {
                pass.timers.push(timer);
                pass.cpu_ms += cpu_ms;
            }
            Some(pass) => *pass = Pass { name, frame, timers: vec![timer], cpu_ms },
            None => self.passes.push(Pass { name, frame, timers: vec![timer], cpu_ms }),
        }
    }

    /// Passes that ran in frame `since` or later.
    fn read(&self, since: u64) -> Vec<PassTime> {
        self.passes.iter().filter(|pass| pass.frame >= since).map(Pass::time).collect()
    }
}

/// Settings of the sum over the VPLs: of one alone, every pixel has its own.
fn sums(settings: &Settings, only: Option<u32>) -> Settings {
    let mut settings = settings.clone();
    if only.is_some() {
        settings.gather.method = GatherMethod::Exact;
    }
    settings
}

/// The meshes of two scenes whose vertices differ; `None` if the scenes differ in more than those, where instances stand,
/// lights, cameras and names.
fn deformed_meshes(a: &Scene, b: &Scene) -> Option<Vec<usize>> {
    let same = a.meshes.len() == b.meshes.len()
        && a.images.len() == b.images.len()
        && a.images.iter().zip(&b.images).all(|(a, b)| Arc::ptr_eq(a, b))
        && a.textures == b.textures
        && a.materials == b.materials
        && a.instances.len() == b.instances.len()
        && a.instances.iter().zip(&b.instances).all(|(a, b)| a.mesh == b.mesh);
    if !same {
        return None;
    }
    let mut deformed = Vec::new();
    for (number, (a, b)) in a.meshes.iter().zip(&b.meshes).enumerate().filter(|(_, (a, b))| !Arc::ptr_eq(a, b)) {
        if a.material != b.material || a.positions.len() != b.positions.len() || a.indices != b.indices {
            return None;
        }
        let vertices = (&a.positions, &a.normals, &a.tangents, &a.uvs, &a.colors);
        if vertices != (&b.positions, &b.normals, &b.tangents, &b.uvs, &b.colors) {
            deformed.push(number);
        }
    }
    Some(deformed)
}

/// Bounds of the scene; of some size where it is empty.
fn bounds(scene: &Scene) -> Bounds {
    scene.bounds().unwrap_or(Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE })
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
