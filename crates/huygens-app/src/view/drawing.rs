//! A renderer with what it drew last: it draws again what differs.

use std::rc::Rc;
use std::time::Instant;

use eframe::egui::TextureId;
use huygens::gl::Context;
use huygens::settings::GatherMethod;
use huygens::{
    Camera, DebugView, Exposure, Governor, Layer, PassTime, RenderOptions, Renderer, Scene, Settings, Shown,
};

/// Frames of a view at rest in which the number of VPLs that a pixel sums still changes.
const GOVERNED: u32 = 60;

/// Surface samples that a frame splats where there is no GPU: all at once would take seconds in which no key does
/// anything.
const SPLATS: u32 = 50_000;

/// What a frame is asked to be: as long as it stays the same, a settled picture does too.
#[derive(Clone, PartialEq)]
pub struct Asked {
    pub settings: Settings,
    pub camera: Camera,
    pub size: [u32; 2],
    pub layer: Layer,
    pub exposure: Exposure,
    pub seed: u32,
    /// Number of the scene, which differs with every change.
    pub scene: u64,
    /// VPLs stay as they are.
    pub frozen: bool,
    /// The one VPL that gives light.
    pub alone: Option<u32>,
    /// Frame rate that decides how many VPLs a pixel sums in a frame; `None`: as many as the settings say.
    pub target_fps: Option<f64>,
    /// An intermediate that is shown in place of the picture.
    pub debug: Option<DebugView>,
}

pub struct Drawing {
    pub renderer: Renderer,
    shown: Option<(Shown, TextureId)>,
    debug: Option<(Shown, TextureId)>,
    asked: Option<Asked>,
    /// The settings that were drawn.
    drawn: Option<Settings>,
    governor: Option<Governor>,
    /// Frames since something else was asked for.
    still: u32,
    /// The last frame made VPLs or maps of them.
    makes: bool,
    software: bool,
}

impl Drawing {
    pub fn new(context: Rc<Context>) -> huygens::Result<Self> {
        let software = context.info().software;
        let mut renderer = Renderer::new(context)?;
        renderer.set_ism_budget(software.then_some(SPLATS));
        Ok(Self {
            renderer,
            shown: None,
            debug: None,
            asked: None,
            drawn: None,
            governor: None,
            still: 0,
            makes: false,
            software,
        })
    }

    /// What was drawn last, and egui's name for its texture.
    pub fn shown(&self) -> Option<(Shown, TextureId)> {
        self.shown
    }

    /// The intermediate that was asked for, if there is such a thing.
    pub fn debug(&self) -> Option<(Shown, TextureId)> {
        self.debug
    }

    /// Size of the last frame, pixels.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.asked.as_ref().map(|asked| asked.size)
    }

    /// VPLs that a pixel sums in a frame.
    pub fn vpls_per_pixel(&self) -> u32 {
        let all = self.renderer.vpls().len() as u32;
        self.drawn.as_ref().map_or(0, |settings| match settings.gather.method {
            GatherMethod::Exact => all,
            GatherMethod::Interleaved => settings.gather.most.min(all),
        })
    }

    pub fn is_settled(&self) -> bool {
        self.shown.is_some_and(|(shown, _)| shown.settled)
    }

    /// Draws the next frame if it would differ from the last one, with as many VPLs a pixel as there is time for; whether
    /// it did. Times of the passes of a frame before go to `times`.
    pub fn draw(
        &mut self,
        frame: &mut eframe::Frame,
        scene: &Scene,
        asked: Asked,
        times: &mut dyn FnMut(Vec<PassTime>),
    ) -> huygens::Result<bool> {
        let same = self.asked.as_ref() == Some(&asked);
        let governed = |a: &Asked, b: &Asked| a.settings == b.settings && a.target_fps == b.target_fps;
        if !self.asked.as_ref().is_some_and(|before| governed(before, &asked)) {
            let governor = |fps| Governor::new(fps, &asked.settings).from_the_coarsest();
            self.governor = asked.target_fps.map(governor);
        }
        // At rest a GPU has time for all that is asked for.
        let exact = asked.settings.gather.method == GatherMethod::Exact && !self.software;
        let as_asked = exact && same && (self.is_settled() || self.drawn.as_ref() == Some(&asked.settings));
        let governor = self.governor.as_ref().filter(|_| !as_asked);
        let settings = governor.map_or(&asked.settings, Governor::settings).clone();
        if same && self.is_settled() && self.drawn.as_ref() == Some(&settings) {
            return Ok(false);
        }
        self.still = if same { self.still + 1 } else { 0 };
        let options = RenderOptions {
            layer: asked.layer,
            exposure: asked.exposure,
            seed: asked.seed,
            ..RenderOptions::new(asked.size[0], asked.size[1], asked.camera.clone())
        };
        self.renderer.check(&settings, &options)?;
        let begun = Instant::now();
        // What fails leaves nothing that could be shown.
        let (before, debug_before) = (self.shown.take(), self.debug.take());
        (self.asked, self.drawn) = (None, None);
        self.renderer.hold_vpls(asked.frozen);
        self.renderer.only_vpl(asked.alone);
        self.renderer.draw(scene, &settings, &options)?;
        let mut named = |shown: Shown, before: Option<(Shown, TextureId)>| {
            let known = before.filter(|(before, _)| before.texture == shown.texture);
            (shown, known.map_or_else(|| frame.register_native_glow_texture(shown.texture), |(_, id)| id))
        };
        self.shown = self.renderer.show()?.map(|shown| named(shown, before));
        if let Some(view) = asked.debug {
            let shown = self.renderer.show_debug(view, asked.size[0], asked.size[1])?;
            self.debug = shown.map(|shown| named(shown, debug_before));
        }
        (self.asked, self.drawn) = (Some(asked), Some(settings));
        let cpu_ms = begun.elapsed().as_secs_f64() * 1e3;
        if let Some(late) = self.renderer.late_pass_times() {
            let sum = |wanted: &dyn Fn(&str) -> bool| -> f64 {
                let wanted = late.iter().filter(|time| wanted(time.name));
                wanted.map(|time| time.gpu_ms.unwrap_or(0.0).max(time.cpu_ms)).sum()
            };
            // What is made once says nothing about the frames that follow, what is made in each frame does. Each step
            // begins the count of what has been summed anew: it would never end.
            let makes = late.iter().any(|time| matches!(time.name, "ism" | "reflected" | "vpl" | "lattice"));
            let usual = !makes || self.makes;
            self.makes = makes;
            if let Some(governor) = self.governor.as_mut().filter(|_| usual && !as_asked && self.still < GOVERNED) {
                governor.frame(sum(&|_| true).max(cpu_ms), sum(&|name| matches!(name, "gather" | "share")));
            }
            times(late);
        }
        Ok(true)
    }

    /// Draws the next frame, whatever was drawn before.
    pub fn forget(&mut self) {
        (self.shown, self.debug, self.asked, self.drawn) = (None, None, None, None);
    }

    /// Lets go of everything on the GPU.
    pub fn clear(&mut self) {
        self.forget();
        if let Ok(empty) = Renderer::new(self.renderer.context().clone()) {
            self.renderer = empty;
        }
    }
}
