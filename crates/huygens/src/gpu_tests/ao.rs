//! Ambient occlusion and its directional form against closed forms.

use glam::{Mat4, Vec3};

use super::{builtins, floor, light, render, with_frame};
use crate::camera::Projection;
use crate::scene::Instance;
use crate::settings::{Settings, Visibility};
use crate::{Camera, Layer, Profile, RenderOptions, Scene};

fn settings(visibility: Visibility) -> Settings {
    let mut settings = Settings { visibility, ..Settings::preset("wave").unwrap() };
    (settings.wave.delta_theta, settings.wave.delta_phi, settings.wave.shells) = (30.0, 30.0, 2);
    settings
}

/// A floor at y = 0 with a wall of the same size at x = −1 that faces +x, seen from above and from the +x side, in
/// perspective or in parallel.
fn corner(projection: Option<Projection>) -> Scene {
    let mut scene = floor(light(Profile::Point));
    let wall = Mat4::from_translation(Vec3::new(-1.0, 0.0, 0.0)) * Mat4::from_rotation_z(-std::f32::consts::FRAC_PI_2);
    scene.instances.push(Instance { mesh: 0, world_from_object: wall });
    let camera = Camera::look_at(Vec3::new(3.0, 5.0, 0.5), Vec3::new(-0.5, 0.4, 0.0), 0.8).unwrap();
    scene.cameras = vec![Camera { projection: projection.unwrap_or(camera.projection), ..camera }];
    scene
}

fn ambient(scene: &Scene, settings: &Settings) -> (Vec<f32>, RenderOptions) {
    let mut options = RenderOptions::new(128, 128, scene.cameras[0].clone());
    options.layer = Layer::Ao;
    let rows = render(scene, settings, &options).linear;
    // First row at the bottom, as the G-buffer has it.
    (rows.chunks(128).rev().flatten().map(|pixel| pixel[0]).collect(), options)
}

#[test]
fn an_open_plane_is_not_occluded() {
    let scene = floor(light(Profile::Point));
    let (ambient, options) = ambient(&scene, &settings(Visibility::None));
    with_frame(&scene, &settings(Visibility::None), &options, |_, pixels| {
        assert!(pixels.len() > 5000);
        for pixel in pixels {
            assert!((ambient[pixel.index] - 1.0).abs() < 0.01, "{}: {}", pixel.position, ambient[pixel.index]);
        }
    });
}

/// A wall that fills a quarter of the sphere above its foot leaves ½ (1 + cos e) of the cosine-weighted hemisphere, e
/// the elevation up to which it counts being 90°: ½ at the foot, and more as surfaces fade out toward the radius.
#[test]
fn a_wall_takes_half_of_what_its_foot_sees_and_nothing_beyond_the_radius() {
    let parallel = Projection::Orthographic { half_height: 2.0 };
    for scene in [corner(None), corner(Some(parallel))] {
        let mut settings = settings(Visibility::None);
        settings.ao.radius = 0.3;
        let (ambient, options) = ambient(&scene, &settings);
        with_frame(&scene, &settings, &options, |frame, pixels| {
            let radius = 0.3 * frame.depth();
            let (mut foot, mut far, mut last) = (Vec::new(), 0, Vec::new());
            for pixel in pixels.iter().filter(|p| p.position.y.abs() < 1e-3 && p.position.z.abs() < 1.5) {
                let (distance, open) = (pixel.position.x + 1.0, ambient[pixel.index]);
                // The wall is seen whole up to a height of the radius only where it does not end.
                if distance < 0.08 * radius {
                    foot.push(open);
                } else if distance > 1.05 * radius {
                    assert!((open - 1.0).abs() < 0.015, "{}: {open}", pixel.position);
                    far += 1;
                } else {
                    last.push((distance, open));
                }
            }
            let mean = foot.iter().sum::<f32>() / foot.len() as f32;
            println!("{} at the foot, {mean}; {far} beyond", foot.len());
            assert!(foot.len() > 20 && far > 500 && (0.48..0.62).contains(&mean), "{mean} of {}", foot.len());
            // It opens up with the distance.
            let of = |range: std::ops::Range<f32>| {
                let inside: Vec<f32> =
                    last.iter().filter(|(d, _)| range.contains(&(d / radius))).map(|(_, open)| *open).collect();
                inside.iter().sum::<f32>() / inside.len() as f32
            };
            let steps = [of(0.1..0.2), of(0.3..0.4), of(0.5..0.6), of(0.8..0.9)];
            println!("{steps:?}");
            assert!(mean < steps[0] && steps.is_sorted_by(|a, b| a < b), "{mean} {steps:?}");
        });
    }
}

#[test]
fn ao_dims_the_unshadowed_sum_and_dao_hides_what_a_wall_hides() {
    // The light behind the wall, facing away from it, and with it every VPL.
    let mut behind = corner(None);
    let axis = Vec3::new(-1.0, -0.5, 0.0).normalize();
    behind.lights[0] = crate::Light { position: Vec3::new(-2.0, 1.0, 0.0), axis, ..light(Profile::Cosine) };
    for scene in builtins().take(2).chain([behind]) {
        let picture = |visibility, layer| {
            let mut options = RenderOptions::new(96, 96, scene.cameras[0].clone());
            options.layer = layer;
            render(&scene, &settings(visibility), &options).linear
        };
        let [none, ao, dao] =
            [Visibility::None, Visibility::Ao, Visibility::Dao].map(|visibility| picture(visibility, Layer::Indirect));
        let open = picture(Visibility::None, Layer::Ao);
        let mut darker = 0;
        for i in 0..none.len() {
            for c in 0..3 {
                let expected = none[i][c] * open[i][c];
                assert!((ao[i][c] - expected).abs() <= 1e-3 * expected, "{} {expected}", ao[i][c]);
                assert!(dao[i][c] <= none[i][c] * 1.0001);
            }
            // Nothing near: next to nothing hidden.
            if open[i][0] > 0.9998 {
                assert!(dao[i][1] >= 0.9 * none[i][1], "{} {}", dao[i][1], none[i][1]);
            }
            darker += usize::from(dao[i][1] < 0.7 * none[i][1]);
        }
        println!("{}: {darker} darker", scene.name);
        assert!(darker > 100, "{}: {darker}", scene.name);
    }
}

/// A floor hides nothing of what is above it, though its shading normal leans: VPLs and horizons are measured from one
/// plane.
#[test]
fn dao_of_an_open_floor_hides_nothing_where_the_shading_normal_leans() {
    let lamp = crate::Light { axis: Vec3::NEG_Y, ..light(Profile::Uniform) };
    let mut scene = floor(lamp);
    std::sync::Arc::make_mut(&mut scene.meshes[0]).normals = vec![Vec3::new(0.5, 0.8, 0.1).normalize(); 4];
    let mut settings = settings(Visibility::None);
    let options = RenderOptions { layer: Layer::Indirect, ..RenderOptions::new(64, 64, scene.cameras[0].clone()) };
    let none = render(&scene, &settings, &options).linear;
    settings.visibility = Visibility::Dao;
    let dao = render(&scene, &settings, &options).linear;
    let sum = |picture: &[[f32; 3]]| picture.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>();
    let ratio = sum(&dao) / sum(&none);
    println!("{ratio}");
    // Directions between two of the sixteen lose some where they cross the plane.
    assert!((0.9..1.0 + 1e-6).contains(&ratio), "{ratio}");
}

/// Against rays: the summed irradiance is nearer with directional ambient occlusion than with none.
#[test]
fn dao_is_nearer_to_rays_than_nothing() {
    for scene in builtins() {
        let settings = [Visibility::None, Visibility::Dao].map(settings);
        let errors = super::visibility_errors(&scene, &settings, 32);
        println!("{}: none, dao: {errors:.3?}", scene.name);
        assert!(errors[1].0 < errors[0].0, "{}: {errors:?}", scene.name);
    }
}
