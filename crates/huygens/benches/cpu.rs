//! What the CPU does when a scene changes: the lattice and its wavefront, the BVH and its rays, surfels and how they are
//! packed, and reflected waves.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use huygens::lattice::{Lattice, LightProbe, Surroundings};
use huygens::reference::{Bvh, Emitters, Surfaces};
use huygens::reflected::Tracer;
use huygens::surfel::Surfels;
use huygens::{Scene, Settings, sampling};

/// The scene with the most triangles.
const SCENE: &str = "atrium";

fn lattice(c: &mut Criterion) {
    let (settings, scene) = (Settings::default(), scene());
    c.bench_function("lattice", |b| b.iter(|| Lattice::new(black_box(&settings.wave))));
    let lattice = Lattice::new(&settings.wave).unwrap();
    let (light, bounds) = (&scene.lights[0], scene.bounds().unwrap());
    let frame = Lattice::frame(light, bounds.center(), bounds.radius());
    let probe = LightProbe {
        scene_depth: Some(bounds.radius()),
        rays: vec![(Some(0.5 * bounds.radius()), Vec3::splat(0.5)); lattice.rays.len()],
    };
    let around = Surroundings { frame, radius: bounds.radius(), albedo: Vec3::splat(0.5), d_min: 0.05, probe: &probe };
    c.bench_function("wavefront", |b| {
        b.iter(|| lattice.wavefront(&settings.wave, settings.strength, black_box(light), &around));
    });
}

fn bvh(c: &mut Criterion) {
    let scene = scene();
    c.bench_function("bvh build", |b| b.iter(|| Bvh::new(black_box(&scene))));
    let (mut bvh, bounds) = (Bvh::new(&scene), scene.bounds().unwrap());
    let direction =
        |i| Vec3::from_array([0, 1, 2].map(|axis| sampling::random(axis, 0, i) - 0.5)).normalize_or(Vec3::X);
    let directions: Vec<Vec3> = (0..1024).map(direction).collect();
    c.bench_function("bvh 1024 rays", |b| {
        b.iter(|| {
            let rays = directions.iter().map(|&direction| bvh.closest(bounds.center(), direction, 0.0, f32::INFINITY));
            rays.flatten().count()
        });
    });
    // The instance with the most triangles goes to and fro.
    let triangles = |i: &usize| scene.meshes[scene.instances[*i].mesh].indices.len();
    let largest = (0..scene.instances.len()).max_by_key(triangles).unwrap();
    let mut moved = scene.clone();
    let (mut there, back) = (1e-3, scene.instances[largest].world_from_object.w_axis.x);
    c.bench_function("bvh follow", |b| {
        b.iter(|| {
            moved.instances[largest].world_from_object.w_axis.x = back + there;
            there = -there;
            bvh.follow(black_box(&moved));
        });
    });
}

fn surfels(c: &mut Criterion) {
    let (settings, scene) = (Settings::default(), scene());
    c.bench_function("surfels", |b| b.iter(|| Surfels::new(black_box(&scene), settings.ism.surfels)));
    let surfels = Surfels::new(&scene, settings.ism.surfels);
    c.bench_function("surfel packing", |b| b.iter(|| surfels.in_world(black_box(&scene))));
}

fn reflected(c: &mut Criterion) {
    let (settings, scene) = (Settings::default(), scene());
    let (surfaces, emitters) = (Surfaces::new(&scene), Emitters::new(&scene));
    let lattice = Lattice::new(&settings.wave).unwrap();
    let tracer = Tracer::new(&surfaces, &emitters, scene.bounds().unwrap(), &lattice, &settings.reflected, 0);
    c.bench_function("reflected", |b| b.iter(|| tracer.run(&lattice, black_box(&scene.lights), settings.strength)));
}

fn scene() -> Scene {
    Scene::builtin(SCENE).unwrap()
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = lattice, bvh, surfels, reflected
}
criterion_main!(benches);
