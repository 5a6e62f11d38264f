//! Shaders that are read from a folder while the program runs.

use std::fs;
use std::path::Path;

use crate::gl::Headless;
use crate::settings::{Settings, Tier, Visibility};
use crate::{Error, Exposure, Layer, RenderOptions, Renderer, Scene};

/// Copies the files of a folder and of those in it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let to = to.join(entry.file_name());
        match entry.file_type().unwrap().is_dir() {
            true => copy(&entry.path(), &to),
            false => drop(fs::copy(entry.path(), to).unwrap()),
        }
    }
}

#[test]
fn shaders_are_read_anew_and_stay_if_one_is_broken() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let folder = tempfile::tempdir().unwrap();
    copy(&source, folder.path());
    let edit = |file: &str, from: &str, to: &str| {
        let text = fs::read_to_string(source.join(file)).unwrap();
        assert!(text.contains(from), "{file}: {from}");
        fs::write(folder.path().join(file), text.replace(from, to)).unwrap();
    };
    let scene = Scene::builtin("column").unwrap();
    let mut options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    (options.layer, options.exposure) = (Layer::Direct, Exposure::Ev(0.0));
    let settings = Settings { visibility: Visibility::None, ..Settings::default() };
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    let draw = |renderer: &mut Renderer| {
        renderer.draw(&scene, &settings, &options).unwrap();
        renderer.read().unwrap().unwrap().display
    };
    let before = draw(&mut renderer);
    let inverted: Vec<_> = before.iter().map(|&[r, g, b, a]| [255 - r, 255 - g, 255 - b, a]).collect();
    let is = |picture: &[[u8; 4]], expected: &[[u8; 4]]| {
        picture.as_flattened().iter().zip(expected.as_flattened()).all(|(a, b)| a.abs_diff(*b) <= 1)
    };
    assert!(!is(&before, &inverted));

    edit("tonemap.frag", "o_color = vec4(color, 1.0)", "o_color = vec4(1.0 - color, 1.0)");
    renderer.read_shaders(folder.path()).unwrap();
    assert!(renderer.read().unwrap().is_none());
    assert!(is(&draw(&mut renderer), &inverted));

    // One that this frame does not need.
    edit("ism_pull.frag", "o_depth = ", "o_depth = nothing + ");
    let text = fs::read_to_string(folder.path().join("ism_pull.frag")).unwrap();
    let line = text.lines().position(|line| line.contains("nothing +")).unwrap() + 1;
    edit("tonemap.frag", "o_color = vec4(color, 1.0)", "o_color = vec4(0.0)");
    let error = renderer.read_shaders(folder.path()).unwrap_err().to_string();
    // As Mesa writes it, or NVIDIA.
    let places = [format!("ism_pull.frag:{line}("), format!("ism_pull.frag({line})")];
    assert!(places.iter().any(|place| error.contains(place)), "{error}");
    assert!(is(&renderer.read().unwrap().unwrap().display, &inverted));
    assert!(is(&draw(&mut renderer), &inverted));
    // A frame that needs it has the old one.
    let mut mapped = Settings { visibility: Visibility::Ism, tier: Tier::Fragment, ..Settings::default() };
    (mapped.wave.delta_theta, mapped.wave.delta_phi) = (30.0, 30.0);
    (mapped.ism.size, mapped.ism.points) = (16, 64);
    let all = RenderOptions { layer: Layer::Final, ..options.clone() };
    renderer.draw(&scene, &mapped, &all).unwrap();
    assert!(is(&draw(&mut renderer), &inverted));

    fs::remove_file(folder.path().join("common/math.glsl")).unwrap();
    let error = renderer.read_shaders(folder.path()).unwrap_err();
    assert!(matches!(&error, Error::File { path, .. } if path.ends_with("common/math.glsl")), "{error}");
    assert!(is(&draw(&mut renderer), &inverted));

    renderer.reload_shaders().unwrap();
    assert!(is(&draw(&mut renderer), &before));
}
