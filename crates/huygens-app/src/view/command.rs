//! The command line that makes the picture of the window.

use std::ffi::OsStr;

use glam::Vec3;
use huygens::camera::Projection;
use huygens::{Camera, Exposure, Layer, Scene, Settings};

use crate::input::Changes;

/// All that a picture of the window is made of.
pub struct Picture<'a> {
    pub source: &'a OsStr,
    pub scene: &'a Scene,
    pub size: [u32; 2],
    pub preset: &'a str,
    pub settings: &'a Settings,
    pub camera: &'a Camera,
    pub layer: Layer,
    pub exposure: Exposure,
    pub seed: u32,
    /// Seconds that animations have played; `None` at rest.
    pub time: Option<f64>,
    pub animation: Option<usize>,
    pub changes: &'a Changes,
}

impl Picture<'_> {
    /// A line for a shell.
    pub fn command(&self, output: &str) -> String {
        let mut line = format!("huygens render {}", quoted(&self.source.to_string_lossy()));
        let mut add = |text: String| {
            line.push(' ');
            line.push_str(&text);
        };
        add(format!("-o {} --size {}x{} --preset {}", quoted(output), self.size[0], self.size[1], self.preset));
        let base = Settings::preset(self.preset).unwrap_or_default();
        for key in huygens::settings::keys() {
            if let (Some(value), Some(default)) = (self.settings.get(&key.name), base.get(&key.name))
                && value != default
            {
                let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                add(format!("--set {}={text}", key.name));
            }
        }
        self.add_camera(&mut add);
        if self.layer != Layer::Final {
            add(format!("--layer {}", self.layer.name()));
        }
        if let Exposure::Ev(ev) = self.exposure {
            add(format!("--exposure {ev}"));
        }
        if self.seed != 0 {
            add(format!("--seed {}", self.seed));
        }
        if let Some(time) = self.time {
            add(format!("--time {time}"));
            if let Some(animation) = self.animation {
                add(format!("--animation {animation}"));
            }
        }
        let (position, axis) = self.changes.light;
        if self.changes.dark {
            add("--light off".to_owned());
        } else if let Some(position) = position {
            add(format!("--light {}", point(position)));
        }
        if let Some(axis) = axis {
            add(format!("--light-axis {}", point(axis)));
        }
        for (instance, by) in &self.changes.moves {
            add(format!("--move {instance}:{}", point(*by)));
        }
        line
    }

    /// The camera of the scene that it is, or what differs from the first one.
    fn add_camera(&self, add: &mut impl FnMut(String)) {
        let camera = self.camera;
        if let Some(index) = self.scene.cameras.iter().position(|other| other == camera) {
            if index > 0 {
                add(format!("--camera {index}"));
            }
            return;
        }
        let same_kind = |other: &Camera| match (other.projection, camera.projection) {
            (Projection::Orthographic { .. }, Projection::Orthographic { .. }) => true,
            (a, b) => matches!((a, b), (Projection::Perspective { .. }, Projection::Perspective { .. })),
        };
        let alike = |other: &Camera| same_kind(other) && other.near == camera.near;
        let cameras = &self.scene.cameras;
        match cameras.iter().position(alike).or_else(|| cameras.iter().position(same_kind)) {
            Some(index) if index > 0 => add(format!("--camera {index}")),
            _ => {}
        }
        // So far away that rounding does not turn it.
        let far = camera.eye.abs().max_element().max(1.0);
        add(format!("--eye {} --target {}", point(camera.eye), point(camera.eye + camera.forward * far)));
        match camera.projection {
            Projection::Perspective { fov_y } => add(format!("--fov {}", fov_y.to_degrees().clamp(1.0, 170.0))),
            Projection::Orthographic { half_height } => add(format!("--view-height {}", 2.0 * half_height)),
        }
    }
}

fn point(p: Vec3) -> String {
    format!("{},{},{}", p.x, p.y, p.z)
}

/// As a POSIX shell takes it for one word.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:+,=@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_what_differs() {
        let scene = Scene::builtin("column").unwrap();
        let mut settings = Settings::preset("balanced").unwrap();
        let mut changes = Changes::default();
        let mut camera = scene.cameras[0].clone();
        let line = |settings: &Settings, camera: &Camera, changes: &Changes| {
            let picture = Picture {
                source: OsStr::new("a b's.glb"),
                scene: &scene,
                size: [64, 48],
                preset: "balanced",
                settings,
                camera,
                layer: Layer::Indirect,
                exposure: Exposure::Ev(-1.5),
                seed: 3,
                time: Some(0.5),
                animation: Some(1),
                changes,
            };
            picture.command("a.png")
        };
        let plain = "huygens render 'a b'\\''s.glb' -o a.png --size 64x48 --preset balanced --layer indirect \
                     --exposure -1.5 --seed 3 --time 0.5 --animation 1";
        assert_eq!(line(&settings, &camera, &changes), plain);
        settings.set("wave.delta_theta", "7.5").unwrap();
        settings.set("visibility", "ao").unwrap();
        camera.eye = Vec3::new(1.0, 2.0, 3.5);
        camera.forward = Vec3::NEG_Z;
        changes.light = (Some(Vec3::X), Some(Vec3::NEG_Y));
        changes.moves.insert(2, Vec3::new(0.0, -1.0, 0.25));
        let all = line(&settings, &camera, &changes);
        for part in [
            " --set visibility=ao --set wave.delta_theta=7.5 --eye 1,2,3.5 --target 1,2,0 --fov ",
            " --light 1,0,0 --light-axis 0,-1,0 --move 2:0,-1,0.25",
        ] {
            assert!(all.contains(part), "{all}");
        }
    }

    /// A command line as the program reads it.
    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        common: crate::cli::Common,
        #[arg(short)]
        o: String,
    }

    #[test]
    fn a_line_gives_the_same_camera() {
        let mut scene = Scene::builtin("column").unwrap();
        let first = scene.cameras[0].clone();
        let flat = Camera { projection: Projection::Orthographic { half_height: 2.0 }, ..first.clone() };
        scene.cameras.extend([Camera { near: Some(0.25), ..first }, flat]);
        let turned = |index: usize, eye: Vec3| {
            let looking = Camera::look_at(eye, eye + Vec3::new(0.3, -0.2, 1.0), 1.0).unwrap();
            let Camera { projection, near, .. } = scene.cameras[index];
            Camera { projection, near, name: String::new(), ..looking }
        };
        let mut cameras = scene.cameras.clone();
        for index in 0..3 {
            cameras.push(turned(index, Vec3::new(0.5, 1.0, -2.0)));
            cameras.push(turned(index, Vec3::new(3e4, 0.0, 1e5)));
        }
        cameras.last_mut().unwrap().projection = Projection::Orthographic { half_height: 0.75 };
        for camera in cameras {
            let picture = Picture {
                source: OsStr::new("builtin:column"),
                scene: &scene,
                size: [64, 48],
                preset: "balanced",
                settings: &Settings::preset("balanced").unwrap(),
                camera: &camera,
                layer: Layer::Final,
                exposure: Exposure::Auto,
                seed: 0,
                time: None,
                animation: None,
                changes: &Changes::default(),
            };
            let line = picture.command("a.png");
            let words = line.split(' ').skip(2).collect::<Vec<_>>();
            let parsed = <Line as clap::Parser>::try_parse_from(std::iter::once("huygens").chain(words)).unwrap();
            let made =
                crate::input::options(&parsed.common, &scene).unwrap_or_else(|e| panic!("{line}: {:#}", e.cause));
            let Camera { eye, forward, up, projection, near, .. } = made.camera;
            assert_eq!((eye, near), (camera.eye, camera.near), "{line}");
            assert!((forward - camera.forward).length() + (up - camera.up).length() < 1e-5, "{line}: {forward} {up}");
            let size = |projection| match projection {
                Projection::Perspective { fov_y } => fov_y,
                Projection::Orthographic { half_height } => -half_height,
            };
            assert!((size(projection) - size(camera.projection)).abs() < 1e-5, "{line}: {projection:?}");
            assert_eq!(parsed.o, "a.png");
        }
    }
}
