//! What every command reads: settings, scene, camera.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::{Mat4, Quat, Vec3};
use huygens::camera::Projection;
use huygens::{Camera, Error, Profile, RenderOptions, Scene, Settings};

use crate::cli::{Common, Frames, Place};
use crate::output::Target;
use crate::{Failure, say};

/// A longer file is not a file of settings; all of them take a few KiB.
const CONFIG_LIMIT: u64 = 1 << 20;

/// Refuses to write two things to one file, or over what is read.
pub fn check_distinct(arguments: &Common, targets: &[&Target]) -> Result<(), Failure> {
    for (i, target) in targets.iter().enumerate() {
        if let Some(other) = targets[..i].iter().find(|other| target.is_same_target(other)) {
            let problem = format_args!("{} names the same file", other.flag).to_string();
            return Err(Failure::bad_input(target, problem, "two different files"));
        }
        let inputs = [Some(Path::new(&arguments.scene)), arguments.config.as_deref()];
        if inputs.iter().flatten().any(|input| target.is_same(input)) {
            return Err(Failure::bad_input(target, "it would replace a file that is read", "another file"));
        }
    }
    Ok(())
}

/// Refuses to write over a file that the scene is made of.
pub fn check_not_of_scene(scene: &Scene, targets: &[&Target]) -> Result<(), Failure> {
    match targets.iter().find(|target| scene.files.iter().any(|file| target.is_same(file))) {
        Some(target) => {
            Err(Failure::bad_input(target, "it would replace a file that the scene is made of", "another file"))
        }
        None => Ok(()),
    }
}

/// Refuses pictures that there is no memory for at so many bytes a pixel; Rust would abort.
pub fn check_memory(arguments: &Common, pixel: usize) -> Result<(), Failure> {
    let [width, height] = arguments.size;
    let bytes = width as usize * height as usize * pixel;
    // Given back at once. Systems refuse what is more than they have.
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(|_| {
        let what = format_args!("--size {width}x{height}").to_string();
        let problem = format_args!("there is no memory for it: it takes {} MiB", bytes >> 20).to_string();
        Failure::bad_input(what, problem, "a smaller picture")
    })
}

/// What the arguments ask to render of a scene.
pub fn options(arguments: &Common, scene: &Scene) -> Result<RenderOptions, Failure> {
    Ok(RenderOptions {
        layer: arguments.layer,
        exposure: arguments.exposure,
        frames: arguments.frames.averaged(),
        seed: arguments.seed,
        ..RenderOptions::new(arguments.size[0], arguments.size[1], camera(arguments, scene)?)
    })
}

/// What is told of a scene with nothing in it.
pub const NO_TRIANGLES: &str = "the scene has no triangles; there is only background";

/// Tells what of the scene is not shown as its file says.
pub fn warn(scene: &Scene) {
    for warning in &scene.warnings {
        say("warning", warning);
    }
    if scene.triangle_count() == 0 {
        say("warning", format_args!("{}: {NO_TRIANGLES}", scene.name));
    }
}

/// Preset, then the file, then each `--set`; the later overrides the earlier.
pub fn settings(arguments: &Common) -> Result<Settings, Failure> {
    settings_from(arguments, Settings::preset(&arguments.preset)?)
}

/// The same from another start.
pub fn settings_from(arguments: &Common, mut settings: Settings) -> Result<Settings, Failure> {
    if let Some(path) = &arguments.config {
        merge_file(&mut settings, path)?;
    }
    for (key, value) in &arguments.set {
        settings.set(key, value)?;
    }
    Ok(settings)
}

/// Takes up what a TOML file sets; leaves `settings` alone on an error.
pub fn merge_file(settings: &mut Settings, path: &Path) -> Result<(), Failure> {
    let refuse = |problem: String| Error::File { path: path.to_owned(), problem };
    let allowed = "allowed: a TOML file of settings, at most 1 MiB of UTF-8";
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(CONFIG_LIMIT + 1).read_to_end(&mut bytes))
        .map_err(|e| refuse(format!("{e}; {allowed}")))?;
    if bytes.len() as u64 > CONFIG_LIMIT {
        return Err(refuse(format!("it is larger than 1 MiB; {allowed}")).into());
    }
    let text = String::from_utf8(bytes).map_err(|_| refuse(format!("it is not UTF-8; {allowed}")))?;
    Ok(settings.merge_toml(&text).map_err(refuse)?)
}

/// The scene, at the time that `--time` says or at rest.
pub fn load(arguments: &Common) -> Result<Scene, Failure> {
    let mut scene = read(&arguments.scene, &mut |_| true)?;
    let numbered = matches!(arguments.frames, Frames::Numbered { .. });
    if (arguments.time.is_some() || numbered) && scene.animations().is_empty() && arguments.light_orbit.is_none() {
        scene.warnings.push(format!("{}: it has no animations and looks the same at every time", scene.name));
    }
    check_changes(arguments, &scene)?;
    match arguments.time {
        Some(seconds) => at(arguments, &scene, seconds),
        None if numbered => Ok(scene),
        None => {
            arguments.changes().apply(&mut scene);
            Ok(scene)
        }
    }
}

/// Refuses to move what is not there or has no place.
pub fn check_changes(arguments: &Common, scene: &Scene) -> Result<(), Failure> {
    let directional = scene.lights.first().is_some_and(|light| light.profile == Profile::Directional);
    if let Some(Place::At(position)) = arguments.light.filter(|_| directional) {
        let what = format!("--light {},{},{}", position.x, position.y, position.z);
        let problem = "it has no influence on the strongest light, which is directional";
        return Err(Failure::bad_input(what, problem, "--light-axis, or --light off"));
    }
    match arguments.moves.iter().find(|(instance, _)| *instance >= scene.instances.len()) {
        Some((instance, by)) => {
            let what = format!("--move {instance}:{},{},{}", by.x, by.y, by.z);
            let allowed = format!("a number below {}", scene.instances.len());
            Err(Failure::bad_input(what, "the scene has no such object", allowed))
        }
        None => Ok(()),
    }
}

/// What stands elsewhere than the scene has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Position and axis of the primary light.
    pub light: (Option<Vec3>, Option<Vec3>),
    /// It gives no light.
    pub dark: bool,
    /// How far objects are moved, m, by the number of the instance.
    pub moves: BTreeMap<usize, Vec3>,
}

impl Changes {
    /// Makes them in a scene.
    pub fn apply(&self, scene: &mut Scene) {
        if let Some(light) = scene.lights.first_mut() {
            let (position, axis) = self.light;
            light.position = position.unwrap_or(light.position);
            light.axis = axis.unwrap_or(light.axis);
            if self.dark {
                light.intensity = Vec3::ZERO;
            }
        }
        for (&instance, &by) in &self.moves {
            if let Some(instance) = scene.instances.get_mut(instance) {
                instance.world_from_object = Mat4::from_translation(by) * instance.world_from_object;
            }
        }
    }
}

/// Index of the animation that is asked for.
pub fn animation(arguments: &Common, scene: &Scene) -> Result<Option<usize>, Failure> {
    let animations = scene.animations();
    let find = |text: &String| {
        let index = text.parse().ok().filter(|&index: &usize| index < animations.len());
        index
            .or_else(|| animations.iter().position(|animation| !animation.name.is_empty() && animation.name == *text))
            .ok_or_else(|| {
                let names = animations.iter().map(|animation| animation.name.as_str());
                let allowed = if animations.is_empty() { "no --animation".to_owned() } else { list(names) };
                Failure::bad_input(format_args!("--animation {text}"), "the scene has no such animation", allowed)
            })
    };
    arguments.animation.as_ref().map(find).transpose()
}

/// A scene, which is at rest, at a time in seconds.
pub fn at(arguments: &Common, scene: &Scene, seconds: f64) -> Result<Scene, Failure> {
    let mut posed = scene.at(seconds, animation(arguments, scene)?)?;
    if let (Some(degrees), Some(light)) = (arguments.light_orbit, posed.lights.first_mut()) {
        let center = scene.bounds().map_or(Vec3::ZERO, |bounds| bounds.center());
        let turn = Quat::from_rotation_y((degrees * seconds % 360.0).to_radians() as f32);
        light.position = center + turn * (light.position - center);
        light.axis = (turn * light.axis).normalize();
    }
    arguments.changes().apply(&mut posed);
    Ok(posed)
}

/// A built-in scene or a file, at rest. `progress` hears the share that is read and says whether to go on.
pub fn read(source: &OsStr, progress: &mut dyn FnMut(f32) -> bool) -> Result<Scene, Failure> {
    if let Some(name) = source.to_str().and_then(|s| s.strip_prefix("builtin:")) {
        return Ok(Scene::builtin(name)?);
    }
    let path = Path::new(source);
    let ending = path.extension().map(|e| e.to_ascii_lowercase());
    if !ending.is_some_and(|e| e == "gltf" || e == "glb") {
        return Err(Failure::bad_input(
            format_args!("scene {}", path.display()),
            "neither a built-in scene nor the name of a glTF file",
            format_args!("a .gltf or .glb file, {}", crate::info::scene_names().join(", ")),
        ));
    }
    Ok(Scene::load_with(path, progress)?)
}

/// Index of the camera that `--camera` chooses.
pub fn camera_index(arguments: &Common, scene: &Scene) -> Result<usize, Failure> {
    let text = arguments.camera.as_deref().unwrap_or("0");
    let index = text.parse().ok().filter(|&index: &usize| index < scene.cameras.len());
    index.or_else(|| scene.cameras.iter().position(|camera| !camera.name.is_empty() && camera.name == text)).ok_or_else(
        || Failure::bad_input(format_args!("--camera {text}"), "the scene has no such camera", cameras(scene)),
    )
}

/// The camera that `--camera` chooses, with what `--eye`, `--target`, `--fov` and `--view-height` replace in it.
fn camera(arguments: &Common, scene: &Scene) -> Result<Camera, Failure> {
    let mut camera = scene.cameras[camera_index(arguments, scene)?].clone();
    let projection = camera.projection;

    camera.eye = arguments.eye.unwrap_or(camera.eye);
    if let Some(target) = arguments.target {
        // The angle is put in below; it has no influence on where the camera looks.
        let looking = Camera::look_at(camera.eye, target, 1.0).ok_or_else(|| {
            let what = format_args!("--target {},{},{}", target.x, target.y, target.z).to_string();
            Failure::bad_input(what, "no direction leads there from the eye", "a point away from the eye, within reach")
        })?;
        camera = Camera { projection, name: camera.name, near: camera.near, ..looking };
    }
    if let Some(fov) = arguments.fov {
        let all_given = arguments.eye.is_some() && arguments.target.is_some();
        if matches!(projection, Projection::Orthographic { .. }) && !all_given {
            return Err(Failure::bad_input(
                format_args!("--fov {fov}"),
                "the chosen camera is orthographic and has no field of view",
                "a perspective camera, or --fov with both --eye and --target",
            ));
        }
        camera.projection = Projection::Perspective { fov_y: fov.to_radians() };
    }
    match (&mut camera.projection, arguments.view_height) {
        (Projection::Orthographic { half_height }, Some(height)) => *half_height = 0.5 * height,
        (Projection::Perspective { .. }, Some(height)) => {
            return Err(Failure::bad_input(
                format_args!("--view-height {height}"),
                "the chosen camera is a perspective one",
                "an orthographic camera",
            ));
        }
        _ => {}
    }
    Ok(camera)
}

fn cameras(scene: &Scene) -> String {
    list(scene.cameras.iter().map(|camera| camera.name.as_str()))
}

/// Indices and names for a message, however many there are.
fn list<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 16;
    let count = names.len();
    let name = |(i, name): (usize, &str)| match name {
        "" => i.to_string(),
        name => format!("{i} ({name})"),
    };
    let mut names: Vec<String> = names.enumerate().take(SHOWN).map(name).collect();
    if count > SHOWN {
        names.push(format!("up to {}", count - 1));
    }
    names.join(", ")
}
