//! Renders a built-in scene without a window and writes it to one_picture.png.

use huygens::gl::Headless;
use huygens::{RenderOptions, Renderer, Scene, Settings};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let headless = Headless::new(None)?;
    let mut renderer = Renderer::new(headless.context())?;
    let scene = Scene::builtin("cornell")?;
    let options = RenderOptions::new(320, 240, scene.cameras[0].clone());
    let picture = renderer.render(&scene, &Settings::default(), &options, &mut |_| ())?;

    let rgba = picture.display.as_flattened();
    image::save_buffer("one_picture.png", rgba, picture.width, picture.height, image::ColorType::Rgba8)?;
    println!("{} VPLs, {} triangles, {:.0} ms", picture.stats.vpls, picture.stats.triangles, picture.stats.frame_ms);
    Ok(())
}
