//! Intermediates as a display shows them.

use glam::{Mat4, Vec3};

use crate::gl::Headless;
use crate::renderer::Frame;
use crate::scene::{Instance, Material, Mesh};
use crate::settings::{Settings, Tier, Visibility};
use crate::{Camera, DebugView, Layer, Light, Profile, RenderOptions, Renderer, Scene};

fn quick() -> Settings {
    let mut settings = Settings::default();
    (settings.wave.delta_theta, settings.wave.delta_phi) = (15.0, 30.0);
    (settings.ism.size, settings.ism.points, settings.ism.surfels) = (16, 64, 4096);
    settings.shadow.size = 64;
    settings.reflected.rays = 2;
    settings
}

/// Width, height and the red of each pixel, rows from the bottom.
fn look(renderer: &mut Renderer, view: DebugView, width: u32, height: u32) -> Option<(u32, u32, Vec<u8>)> {
    let shown = renderer.show_debug(view, width, height).unwrap()?;
    assert!(shown.width <= width && shown.height <= height && (shown.width == width || shown.height == height));
    let pixels = renderer.context().read_texture(shown.texture, shown.width, shown.height);
    if view != DebugView::VplTexture {
        assert!(pixels.iter().all(|&[r, g, b, a]| r == g && r == b && a == 255));
    }
    Some((shown.width, shown.height, pixels.iter().map(|p| p[0]).collect()))
}

fn varies(pixels: &[u8]) -> bool {
    pixels.iter().any(|p| *p != pixels[0])
}

#[test]
fn intermediates_show_and_only_those_that_there_are() {
    let scene = Scene::builtin("column").unwrap();
    let mut options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    use DebugView::{IsmAtlas, IsmTile, ShadowMap, VplTexture};
    assert!(look(&mut renderer, ShadowMap, 30, 20).is_none());
    for tier in [Tier::Fragment, Tier::Compute] {
        let mut settings = Settings { tier, ..quick() };
        renderer.draw(&scene, &settings, &options).unwrap();
        let count = renderer.vpls().len() as u32;
        let atlas = look(&mut renderer, IsmAtlas, 1024, 1024).unwrap();
        let tile = look(&mut renderer, IsmTile(count - 1), 50, 32).unwrap();
        assert_eq!((tile.0, tile.1), (32, 32));
        for (_, _, pixels) in [&atlas, &tile, &look(&mut renderer, VplTexture, 90, 90).unwrap()] {
            assert!(varies(pixels), "{tier:?}");
        }
        assert!(look(&mut renderer, IsmTile(count), 32, 32).is_none());
        // A tile at the size that it has is a part of the atlas.
        let columns = f64::from(count).sqrt().ceil() as u32;
        let size = [columns, count.div_ceil(columns)].map(|tiles| tiles * 16);
        let (width, height, atlas) = look(&mut renderer, IsmAtlas, size[0], size[1]).unwrap();
        assert_eq!([width, height], size);
        for index in [0, 1, columns + 2, count - 1] {
            let (.., tile) = look(&mut renderer, IsmTile(index), 16, 16).unwrap();
            let (x, y) = (index % columns * 16, height - 16 - index / columns * 16);
            let part = (0..16).flat_map(|row| &atlas[((y + row) * width + x) as usize..][..16]);
            assert!(part.eq(&tile), "{tier:?} {index}");
        }
        // What is after the last one is empty.
        if !count.is_multiple_of(columns) {
            assert_eq!(atlas[width as usize - 1], 255);
        }
        // The first ones have regular shadow maps.
        settings.visibility = Visibility::Mixed;
        settings.shadow_maps.count = 4;
        renderer.draw(&scene, &settings, &options).unwrap();
        assert!(look(&mut renderer, IsmTile(3), 32, 32).is_none() && look(&mut renderer, IsmTile(4), 32, 32).is_some());
    }
    renderer.draw(&scene, &Settings { visibility: Visibility::None, ..quick() }, &options).unwrap();
    assert!(look(&mut renderer, IsmAtlas, 32, 32).is_none() && look(&mut renderer, VplTexture, 32, 32).is_some());
    options.layer = Layer::Direct;
    renderer.draw(&scene, &quick(), &options).unwrap();
    assert!(look(&mut renderer, VplTexture, 32, 32).is_none() && look(&mut renderer, ShadowMap, 32, 32).is_some());
    let dark = Scene { lights: Vec::new(), ..scene };
    renderer.draw(&dark, &quick(), &options).unwrap();
    assert!(look(&mut renderer, ShadowMap, 32, 32).is_none());
}

/// Each tile as it is, its first row at the bottom, and the tiles from the upper left.
#[test]
fn the_atlas_shows_the_texels_of_the_maps() {
    let scene = Scene::builtin("column").unwrap();
    let options = RenderOptions::new(16, 16, scene.cameras[0].clone());
    let headless = Headless::new(None).unwrap();
    let context = headless.context();
    let mut frame = Frame::new(&context, &scene, &quick(), &options).unwrap();
    frame.run(0, 1, false, None).unwrap();
    let texels = frame.ism.as_ref().unwrap().read();
    let (width, count) = (frame.ism.as_ref().unwrap().layout().columns * 16, frame.vpls.len() as u32);
    let height = texels.len() as u32 / width;
    let shown = frame.show_debug(DebugView::IsmAtlas, [width, height]).unwrap().unwrap();
    assert_eq!([shown.width, shown.height], [width, height]);
    let pixels = context.read_texture(shown.texture, width, height);
    for (i, texel) in texels.iter().enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        if y / 16 * (width / 16) + x / 16 < count {
            let pixel = pixels[((height / 16 - 1 - y / 16) * 16 + y % 16) as usize * width as usize + x as usize];
            assert!((f32::from(pixel[0]) - texel[0] * 255.0).abs() < 1.0, "{x} {y}: {pixel:?} {texel:?}");
        }
    }
}

/// Texels of the VPLs, as the list has them.
#[test]
fn the_vpl_texture_shows_what_the_vpls_are() {
    let scene = Scene::builtin("column").unwrap();
    let options = RenderOptions::new(48, 32, scene.cameras[0].clone());
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    renderer.draw(&scene, &Settings { visibility: Visibility::None, ..quick() }, &options).unwrap();
    let vpls = renderer.vpls().to_vec();
    let columns = (0.5 * (vpls.len() as f64).sqrt()).ceil() as u32;
    let size = [4 * columns, (vpls.len() as u32).div_ceil(columns)];
    let shown = renderer.show_debug(DebugView::VplTexture, size[0], size[1]).unwrap().unwrap();
    assert_eq!([shown.width, shown.height], size);
    let pixels = renderer.context().read_texture(shown.texture, size[0], size[1]);
    let bounds = scene.bounds().unwrap();
    let greatest = vpls.iter().map(|vpl| vpl.intensity.max_element()).fold(0.0, f32::max);
    for (i, vpl) in vpls.iter().enumerate() {
        let (x, y) = (i as u32 % columns * 4, size[1] - 1 - i as u32 / columns);
        let texels = &pixels[(y * size[0] + x) as usize..][..4];
        let is = |texel: usize, expected: Vec3| {
            let got = Vec3::new(texels[texel][0].into(), texels[texel][1].into(), texels[texel][2].into());
            let difference = got - expected.clamp(Vec3::ZERO, Vec3::ONE) * 255.0;
            assert!(difference.abs().max_element() < 1.01, "{i} {texel}: {got} {expected}");
        };
        is(0, (vpl.position - bounds.min) / (bounds.max - bounds.min));
        is(1, vpl.direction * 0.5 + 0.5);
        let shown = crate::reference::tonemap::display(&[(vpl.intensity / greatest).to_array()], 0.0)[0];
        is(2, Vec3::new(shown[0].into(), shown[1].into(), shown[2].into()) / 255.0);
        is(3, Vec3::from_slice(&vpl.extent) / bounds.radius());
    }
}

/// A light in the middle of a closed box sees each wall where it is.
#[test]
fn the_shadow_map_shows_the_distance_of_each_wall() {
    // Half its edges, m; the light's axis is −z, so that the face +z of light space sees the wall there.
    let half = Vec3::new(1.0, 2.0, 3.0);
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| {
                let mut corner = [side; 3];
                (corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (u, v);
                Vec3::from(corner) * half
            });
            // Facing in.
            if side > 0.0 {
                corners.reverse();
            }
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            let mut normal = [0.0; 3];
            normal[axis] = -side;
            mesh.normals.extend([Vec3::from(normal); 4]);
            mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    let axis = Vec3::NEG_Z;
    let light = |profile| Light { name: String::new(), position: Vec3::ZERO, axis, intensity: Vec3::ONE, profile };
    let scene = |profile| Scene {
        name: "box".to_owned(),
        meshes: vec![mesh.clone().into()],
        materials: vec![Material::lambert("grey", Vec3::splat(0.5))],
        instances: vec![Instance { mesh: 0, world_from_object: Mat4::IDENTITY }],
        lights: vec![light(profile)],
        cameras: vec![Camera::look_at(Vec3::new(0.5, 1.0, 2.5), Vec3::ZERO, 0.9).unwrap()],
        ..Scene::default()
    };
    let (x, y) = axis.any_orthonormal_pair();
    // +x, +y, +z above −x, −y, −z.
    let far = half.length() * 1.01;
    let walls = [x, y, axis].map(|direction| (direction.abs().dot(half) / far * 255.0) as u8);
    let headless = Headless::new(None).unwrap();
    let mut renderer = Renderer::new(headless.context()).unwrap();
    for (profile, behind) in [(Profile::Point, walls[2]), (Profile::Cosine, 255)] {
        let scene = scene(profile);
        let options = RenderOptions::new(16, 16, scene.cameras[0].clone());
        renderer.draw(&scene, &quick(), &options).unwrap();
        let (width, height, pixels) = look(&mut renderer, DebugView::ShadowMap, 1000, 128).unwrap();
        assert_eq!((width, height), (192, 128));
        for (column, wall) in walls.into_iter().enumerate() {
            // A face has 64 x 64 pixels; rows from the bottom.
            let middle = |row: usize| pixels[(row * 64 + 32) * 192 + column * 64 + 32];
            // At the middle of the other faces begins what is behind the light.
            if column == 2 || profile == Profile::Point {
                let other = if column == 2 { behind } else { wall };
                let got = [middle(1), middle(0)];
                assert!(
                    got[0].abs_diff(wall) <= 1 && got[1].abs_diff(other) <= 1,
                    "{profile:?} {column} {got:?} {walls:?}"
                );
            }
            assert!(varies(&pixels));
        }
    }
}
