//! The built-in scenes: what the program shows without a file, and what tests, measurements and pictures in the
//! documentation use. All of them are generated, the same on every machine: y up, metres, one light, one camera.
//!
//! `cornell` has published measurements; `column` and `corridor` are small rooms where most of what is seen is
//! shadow and indirect light; `atrium` is a two-storey colonnade with curtains, of the size of a real scene.

use std::f32::consts::{PI, TAU};

use glam::{Mat4, Vec3, vec3};

use super::{Instance, Material, Mesh, Scene};
use crate::{Camera, Error, Light, Profile, Result};

/// Name and one-line description of every built-in scene, the default one first.
pub const BUILTIN_NAMES: [(&str, &str); 4] = [
    ("cornell", "the Cornell box as measured: 0.55 m, red and green walls, two blocks, open in front"),
    ("column", "a room with one warm and one cool wall; a column stands between the light and half of it"),
    ("corridor", "an L-shaped corridor with the light round the corner: mostly indirect light"),
    ("atrium", "a two-storey colonnade with galleries and curtains, 0.2 million triangles"),
];

impl Scene {
    /// Generates the built-in scene of that name (one of [`BUILTIN_NAMES`], without `builtin:`).
    pub fn builtin(name: &str) -> Result<Scene> {
        let scene = match name {
            "cornell" => cornell(),
            "column" => column(),
            "corridor" => corridor(),
            "atrium" => atrium(),
            _ => {
                return Err(Error::Argument {
                    what: "scene",
                    problem: format!("there is no built-in scene `{name}`"),
                    allowed: BUILTIN_NAMES.map(|(name, _)| format!("builtin:{name}")).join(", "),
                });
            }
        };
        Ok(Scene { name: format!("builtin:{name}"), ..scene })
    }
}

/// The Cornell box, from "Cornell Box Data" (Cornell University Program of Computer Graphics, 1998,
/// <https://www.graphics.cornell.edu/online/box/data.html>): vertices and camera as published, in metres instead of
/// millimetres. The walls are as little rectangular as the real ones.
///
/// Albedos are the published spectra as linear RGB, as Pharr, Jakob and Humphreys' and Mitsuba's scene files carry
/// them. The light is a Lambertian point emitter instead of the published patch of 130 × 105 mm, at its centre.
fn cornell() -> Scene {
    let mut scene = Scene::default();
    let [white, red, green] =
        [("white", vec3(0.725, 0.71, 0.68)), ("red", vec3(0.63, 0.065, 0.05)), ("green", vec3(0.14, 0.45, 0.091))]
            .map(|(name, albedo)| scene.add_material(Material::lambert(name, albedo)));

    type Quad = [[f32; 3]; 4];
    let floor: Quad = [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]];
    let ceiling: Quad = [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]];
    let back: Quad = [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]];
    let right: Quad = [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]];
    let left: Quad = [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]];
    let short_block: [Quad; 5] = [
        [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]],
        [[290.0, 0.0, 114.0], [290.0, 165.0, 114.0], [240.0, 165.0, 272.0], [240.0, 0.0, 272.0]],
        [[130.0, 0.0, 65.0], [130.0, 165.0, 65.0], [290.0, 165.0, 114.0], [290.0, 0.0, 114.0]],
        [[82.0, 0.0, 225.0], [82.0, 165.0, 225.0], [130.0, 165.0, 65.0], [130.0, 0.0, 65.0]],
        [[240.0, 0.0, 272.0], [240.0, 165.0, 272.0], [82.0, 165.0, 225.0], [82.0, 0.0, 225.0]],
    ];
    let tall_block: [Quad; 5] = [
        [[423.0, 330.0, 247.0], [265.0, 330.0, 296.0], [314.0, 330.0, 456.0], [472.0, 330.0, 406.0]],
        [[423.0, 0.0, 247.0], [423.0, 330.0, 247.0], [472.0, 330.0, 406.0], [472.0, 0.0, 406.0]],
        [[472.0, 0.0, 406.0], [472.0, 330.0, 406.0], [314.0, 330.0, 456.0], [314.0, 0.0, 456.0]],
        [[314.0, 0.0, 456.0], [314.0, 330.0, 456.0], [265.0, 330.0, 296.0], [265.0, 0.0, 296.0]],
        [[265.0, 0.0, 296.0], [265.0, 330.0, 296.0], [423.0, 330.0, 247.0], [423.0, 0.0, 247.0]],
    ];
    for (name, material, quads) in [
        ("floor", white, &[floor][..]),
        ("ceiling", white, &[ceiling]),
        ("back wall", white, &[back]),
        ("right wall", green, &[right]),
        ("left wall", red, &[left]),
        ("short block", white, &short_block),
        ("tall block", white, &tall_block),
    ] {
        let mut mesh = Mesh::new(name, material);
        for quad in quads {
            mesh.quad(quad.map(|p| Vec3::from(p) / 1000.0));
        }
        scene.add(mesh);
    }

    // The picture is taken along +z, so its right-hand side is −x: red stands on the left as published.
    let eye = vec3(0.278, 0.273, -0.8);
    let fov_y = 2.0 * (0.5 * 0.025_f32 / 0.035).atan();
    scene.cameras.extend(Camera::look_at(eye, eye + Vec3::Z, fov_y));
    scene.lights.push(Light {
        name: "light".to_owned(),
        // 1 cm below the ceiling: further than a shadow map's near plane and depth offset in a box of this size.
        position: vec3(0.278, 0.5388, 0.2795),
        axis: Vec3::NEG_Y,
        intensity: 4.0 * vec3(1.0, 0.85, 0.6),
        profile: Profile::Cosine,
    });
    scene
}

/// A closed room of 6 × 3 × 8 m with a round column.
fn column() -> Scene {
    let mut scene = Scene::default();
    let (min, max) = (vec3(-3.0, 0.0, -4.0), vec3(3.0, 3.0, 4.0));
    let white = scene.add_material(Material::lambert("white", Vec3::splat(0.75)));
    let floor = scene.add_material(Material::lambert("floor", vec3(0.45, 0.4, 0.35)));
    let warm = scene.add_material(Material::lambert("warm", vec3(0.75, 0.28, 0.1)));
    let cool = scene.add_material(Material::lambert("cool", vec3(0.12, 0.32, 0.65)));
    let names = ["wall −x", "wall +x", "floor", "ceiling", "wall −z", "wall +z"];
    let materials = [cool, warm, floor, white, white, white];
    for ((name, material), mut face) in names.into_iter().zip(materials).zip(cuboid_faces(min, max)) {
        face.reverse();
        let mut mesh = Mesh::new(name, material);
        mesh.quad(face);
        scene.add(mesh);
    }
    let mut mesh = Mesh::new("column", white);
    // A little longer than the room is high, so that no light passes at its ends.
    mesh.lathe(64, &[(0.35, -0.01), (0.35, 1.5), (0.35, 3.01)]);
    scene.add_at(mesh, [Mat4::from_translation(vec3(-0.3, 0.0, -0.6))]);

    scene.cameras.extend(Camera::look_at(vec3(0.9, 1.65, 3.7), vec3(0.25, 1.15, -2.0), 62_f32.to_radians()));
    scene.lights.push(Light {
        name: "light".to_owned(),
        position: vec3(-2.1, 2.95, -0.9),
        axis: Vec3::NEG_Y,
        intensity: 16.0 * vec3(1.0, 0.9, 0.75),
        profile: Profile::Cosine,
    });
    scene
}

/// Two arms of a closed corridor, 2 m wide and 2.7 m high, that meet at a right angle: the camera stands in one, the
/// light hangs in the other.
fn corridor() -> Scene {
    const HEIGHT: f32 = 2.7;
    let mut scene = Scene::default();
    let white = scene.add_material(Material::lambert("white", Vec3::splat(0.8)));
    let floor = scene.add_material(Material::lambert("floor", vec3(0.55, 0.5, 0.45)));
    let orange = scene.add_material(Material::lambert("orange", vec3(0.8, 0.35, 0.1)));
    let teal = scene.add_material(Material::lambert("teal", vec3(0.1, 0.4, 0.42)));

    // The outline in x and z with the wall that starts at each point, walked with the inside on the right seen from
    // above. Points in the middle of straight walls are where floor tiles meet, so that there are no T-junctions.
    let outline = [
        (0.0, 0.0, orange),
        (0.0, 2.0, white),
        (0.0, 6.0, white),
        (2.0, 6.0, white),
        (2.0, 2.0, white),
        (7.0, 2.0, white),
        (7.0, 0.0, white),
        (2.0, 0.0, teal),
    ];
    let at = |(x, z): (f32, f32), y: f32| vec3(x, y, z);
    for (i, &(x, z, material)) in outline.iter().enumerate() {
        let (next_x, next_z, _) = outline[(i + 1) % outline.len()];
        let (a, b) = ((x, z), (next_x, next_z));
        let mut mesh = Mesh::new("wall", material);
        mesh.quad([at(b, 0.0), at(a, 0.0), at(a, HEIGHT), at(b, HEIGHT)]);
        scene.add(mesh);
    }
    let (mut below, mut above) = (Mesh::new("floor", floor), Mesh::new("ceiling", white));
    for ((x0, z0), (x1, z1)) in [((0.0, 0.0), (2.0, 2.0)), ((0.0, 2.0), (2.0, 6.0)), ((2.0, 0.0), (7.0, 2.0))] {
        let corners = [(x0, z0), (x0, z1), (x1, z1), (x1, z0)];
        below.quad(corners.map(|c| at(c, 0.0)));
        let mut top = corners.map(|c| at(c, HEIGHT));
        top.reverse();
        above.quad(top);
    }
    scene.add(below);
    scene.add(above);
    let mut mesh = Mesh::new("box", white);
    // Sunk into the floor, so that no two faces lie in one plane.
    mesh.cuboid(vec3(-0.25, -0.01, -0.25), vec3(0.25, 0.8, 0.25));
    scene.add_at(mesh, [Mat4::from_translation(vec3(0.55, 0.0, 2.6)) * Mat4::from_rotation_y(0.5)]);

    scene.cameras.extend(Camera::look_at(vec3(1.4, 1.6, 5.3), vec3(0.8, 1.15, 0.0), 62_f32.to_radians()));
    scene.lights.push(Light {
        name: "light".to_owned(),
        position: vec3(5.5, 2.6, 1.0),
        axis: vec3(-1.0, -0.6, 0.0).normalize(),
        intensity: 30.0 * vec3(1.0, 0.92, 0.8),
        profile: Profile::Cosine,
    });
    scene
}

/// A courtyard of 31 × 16 × 11 m under a vault. A ring of columns stands 24 × 9 m apart on either storey, in bays of
/// 3 m; aisles and galleries run behind it.
fn atrium() -> Scene {
    const BAY: f32 = 3.0;
    /// Half of the ring of columns, and of the walls, along x and z.
    const RING: [f32; 2] = [12.0, 4.5];
    const WALL: [f32; 2] = [15.5, 8.0];
    /// Height of a column, and scale of the upper ones.
    const COLUMN: f32 = 3.5;
    const UPPER: f32 = 0.75;
    /// Height of an arcade's wall above the columns.
    const ARCADE: f32 = 1.45;
    /// Floor of the gallery, and the ceiling above it.
    const GALLERY: f32 = 5.1;
    const CEILING: f32 = 9.1;

    let mut scene = Scene::default();
    let stone = scene.add_material(Material::lambert("sandstone", vec3(0.62, 0.53, 0.42)));
    let marble = scene.add_material(Material::lambert("marble", vec3(0.74, 0.71, 0.66)));
    let plaster = scene.add_material(Material::lambert("plaster", vec3(0.66, 0.61, 0.53)));
    let wood = scene.add_material(Material::lambert("wood", vec3(0.28, 0.16, 0.08)));
    let polished = |name, albedo| Material { specular: 1.0, roughness: 0.4, ..Material::lambert(name, albedo) };
    let tiles = [("light tiles", vec3(0.55, 0.5, 0.43)), ("dark tiles", vec3(0.2, 0.13, 0.1))]
        .map(|(name, albedo)| scene.add_material(polished(name, albedo)));
    let cloth = [("red", vec3(0.6, 0.05, 0.05)), ("green", vec3(0.07, 0.38, 0.1)), ("blue", vec3(0.06, 0.12, 0.5))]
        .map(|(name, albedo)| scene.add_material(Material::lambert(name, albedo)));

    // The outer walls close the scene; the vault and the floor tiles stand within them.
    let mut shell = Mesh::new("walls", plaster);
    for mut face in cuboid_faces(vec3(-WALL[0], -0.05, -WALL[1]), vec3(WALL[0], 11.6, WALL[1])) {
        face.reverse();
        shell.quad(face);
    }
    scene.add(shell);

    // Tiles of 1 m with bevelled edges, in two colours like a chessboard; they run a little into the walls.
    let [mut light_tiles, mut dark_tiles] = tiles.map(|material| Mesh::new("floor", material));
    for z in -8..8_i32 {
        for x in -16..16_i32 {
            let mesh = if (x + z).rem_euclid(2) == 0 { &mut light_tiles } else { &mut dark_tiles };
            mesh.tile(vec3(x as f32, 0.0, z as f32), 1.0, 0.012);
        }
    }
    scene.add(light_tiles);
    scene.add(dark_tiles);

    // Where bays stand in a ring: each from its column along its own +x, with the nave on its +z side.
    let mut bays = Vec::new();
    let corners = [vec3(RING[0], 0.0, -RING[1]), vec3(-RING[0], 0.0, -RING[1])];
    for (start, end) in [(corners[1], corners[0]), (-corners[1], -corners[0])] {
        push_bays(&mut bays, start, end, BAY);
    }
    for (start, end) in [(corners[0], -corners[1]), (-corners[0], corners[1])] {
        push_bays(&mut bays, start, end, BAY);
    }
    let raised = |y: f32| Mat4::from_translation(vec3(0.0, y, 0.0));
    let upper = raised(GALLERY) * Mat4::from_scale(Vec3::splat(UPPER));

    // Columns: one at the start of every bay, on both storeys.
    let feet: Vec<Mat4> = bays.iter().map(|bay| Mat4::from_translation(bay.transform_point3(Vec3::ZERO))).collect();
    scene.add_at(fluted_column(stone, COLUMN), feet.iter().copied().chain(feet.iter().map(|&foot| foot * upper)));

    // Arcades on the columns of both storeys, with posts where two of them meet.
    let springings = [COLUMN, GALLERY + UPPER * COLUMN];
    let on_both = |bay: &Mat4| springings.map(|y| *bay * raised(y));
    scene.add_at(arch(plaster, BAY, 1.2, ARCADE, 0.25), bays.iter().flat_map(on_both));
    let mut post = Mesh::new("corner post", plaster);
    // 1 cm thicker than the arcades, and higher into the slab.
    post.cuboid(vec3(-0.26, 0.0, -0.26), vec3(0.26, ARCADE + 0.02, 0.26));
    let posts = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
        .map(|(x, z)| Mat4::from_translation(vec3(x * RING[0], 0.0, z * RING[1])));
    scene.add_at(post, posts.iter().flat_map(on_both));

    // The gallery and the ceiling above it, both a ring with an edge that juts out into the nave.
    let mut slabs = Mesh::new("galleries", marble);
    let inner = |overhang: f32| [RING[0] - overhang, RING[1] - overhang];
    slabs.ring([GALLERY - 0.2, GALLERY], inner(0.42), WALL.map(|w| w + 0.02));
    slabs.ring([CEILING, CEILING + 0.25], inner(0.36), WALL.map(|w| w + 0.02));
    scene.add(slabs);

    // Balustrades between the upper columns.
    let mut balustrade = Mesh::new("balustrade", marble);
    balustrade.cuboid(vec3(0.2, 0.04, -0.07), vec3(BAY - 0.2, 0.16, 0.07));
    balustrade.cuboid(vec3(0.12, 0.9, -0.09), vec3(BAY - 0.12, 1.0, 0.09));
    for i in 0..7 {
        let x = 0.5 + (BAY - 1.0) * i as f32 / 6.0;
        let profile =
            [(0.075, 0.15), (0.05, 0.2), (0.085, 0.36), (0.07, 0.5), (0.035, 0.68), (0.05, 0.8), (0.07, 0.91)];
        balustrade.lathe_at(vec3(x, 0.0, 0.0), 14, &profile);
    }
    scene.add_at(balustrade, bays.iter().map(|&bay| bay * raised(GALLERY)));

    // A barrel vault over the nave, closed at its ends; its edges lie behind the ceiling's.
    let (half_x, half_z, base, rise) = (RING[0] - 0.32, RING[1] - 0.3, CEILING + 0.1, 2.2);
    let vault_point = |x: f32, t: f32| vec3(x, base + rise * (PI * t).sin(), -half_z * (PI * t).cos());
    let mut vault = Mesh::new("vault", plaster);
    vault.grid([48, 40], false, |u, v| vault_point((2.0 * u - 1.0) * (half_x + 0.05), v));
    for side in [-1.0_f32, 1.0] {
        vault.grid([40, 1], false, |u, v| {
            // Along z so that the front looks into the nave.
            let top = vault_point(side * half_x, if side < 0.0 { 1.0 - u } else { u });
            vec3(top.x, base + (top.y - base) * v, top.z)
        });
    }
    scene.add(vault);
    let mut rib = Mesh::new("rib", stone);
    // Three sides of a bar that runs along the vault.
    let section = [(0.14, 0.05), (0.14, -0.1), (-0.14, -0.1), (-0.14, 0.05)];
    for side in section.windows(2) {
        rib.grid([1, 40], false, |u, v| {
            let (x, out) = (side[0].0 + u * (side[1].0 - side[0].0), side[0].1 + u * (side[1].1 - side[0].1));
            let radius = [half_z + out, rise + out];
            vec3(-x, base + radius[1] * (PI * v).sin(), -radius[0] * (PI * v).cos())
        });
    }
    scene.add_at(rib, (-3..=3).map(|i| Mat4::from_translation(vec3(BAY * i as f32, 0.0, 0.0))));

    // Curtains on rods in some of the lower arches. The first 16 bays are the long sides.
    let mut rod = Mesh::new("rod", wood);
    rod.lathe(12, &[(0.03, 0.1), (0.03, BAY - 0.1)]);
    let hung = [[1, 6, 11], [3, 9, 14], [4, 8, 12]];
    let lying = raised(3.35) * Mat4::from_rotation_z(-0.5 * PI);
    scene.add_at(rod, hung.as_flattened().iter().map(|&i| bays[i] * lying));
    for (material, places) in cloth.into_iter().zip(hung) {
        let mut curtain = Mesh::new("curtain", material);
        curtain.grid([80, 24], false, |u, v| {
            // Folds get deeper further down, and the cloth is gathered half-way.
            let fall = 1.0 - v;
            let fold = (TAU * (7.0 * u + 0.15 * fall * (TAU * u).sin())).sin();
            let x = 0.5 * BAY + (u - 0.5) * (BAY - 0.9) * (1.0 - 0.1 * (PI * v).sin());
            vec3(x, 0.35 + 2.94 * v, (0.05 + 0.07 * fall) * fold)
        });
        scene.add_at(curtain, places.map(|i| bays[i]));
    }

    scene.cameras.extend(Camera::look_at(vec3(-11.2, 2.0, -0.9), vec3(4.0, 3.3, 0.5), 62_f32.to_radians()));
    scene.lights.push(Light {
        name: "light".to_owned(),
        position: vec3(-1.5, 8.6, 0.4),
        axis: Vec3::NEG_Y,
        intensity: 260.0 * vec3(1.0, 0.92, 0.78),
        profile: Profile::Uniform,
    });
    scene
}

/// Bays of `length` metres from `start` to `end`, each standing at its first column with +x along the row.
fn push_bays(bays: &mut Vec<Mat4>, start: Vec3, end: Vec3, length: f32) {
    let along = (end - start).normalize();
    let count = ((end - start).length() / length).round() as u32;
    for i in 0..count {
        let axes = [along, Vec3::Y, along.cross(Vec3::Y)].map(|axis| axis.round().extend(0.0));
        let origin = start + along * (length * i as f32);
        bays.push(Mat4::from_cols(axes[0], axes[1], axes[2], origin.extend(1.0)));
    }
}

/// A column of `height` metres at the origin: plinth, base of two tori, fluted shaft with entasis, capital, abacus.
fn fluted_column(material: usize, height: f32) -> Mesh {
    let mut mesh = Mesh::new("column", material);
    mesh.cuboid(vec3(-0.4, -0.01, -0.4), vec3(0.4, 0.12, 0.4));
    mesh.lathe(
        40,
        &[
            (0.36, 0.11),
            (0.39, 0.15),
            (0.39, 0.19),
            (0.35, 0.22),
            (0.32, 0.24),
            (0.33, 0.27),
            (0.35, 0.29),
            (0.34, 0.32),
            (0.3, 0.34),
            (0.27, 0.37),
        ],
    );
    // 20 flutes, as the Doric order has, with four vertices each.
    let (bottom, top) = (0.33, height - 0.36);
    mesh.grid([80, 8], true, |u, v| {
        let entasis = 1.0 - 0.14 * v.powf(1.6);
        let flute = 0.5 - 0.5 * (TAU * 20.0 * u).cos();
        let radius = 0.29 * entasis * (1.0 - 0.07 * flute);
        around(u, radius, bottom + (top - bottom) * v)
    });
    let y = height - 0.4;
    mesh.lathe(
        40,
        &[
            (0.24, y),
            (0.28, y + 0.02),
            (0.29, y + 0.05),
            (0.27, y + 0.08),
            (0.27, y + 0.12),
            (0.31, y + 0.17),
            (0.36, y + 0.22),
            (0.385, y + 0.27),
            (0.38, y + 0.31),
        ],
    );
    mesh.cuboid(vec3(-0.42, height - 0.1, -0.42), vec3(0.42, height, 0.42));
    mesh
}

/// One bay of an arcade: a wall from x = 0 to `width` and from y = 0 to `height`, `half_depth` to either side of
/// z = 0, with a round arch of `radius` metres cut out in the middle of its lower edge.
fn arch(material: usize, width: f32, radius: f32, height: f32, half_depth: f32) -> Mesh {
    const SEGMENTS: usize = 32;
    let mut mesh = Mesh::new("arch", material);
    let curve = |t: f32| (0.5 * width - radius * (PI * t).cos(), radius * (PI * t).sin());
    mesh.grid([1, SEGMENTS], false, |u, v| {
        let (x, y) = curve(v);
        vec3(x, y, half_depth * (1.0 - 2.0 * u))
    });
    let mut columns = vec![(0.0, 0.0)];
    columns.extend((0..=SEGMENTS).map(|i| curve(i as f32 / SEGMENTS as f32)));
    columns.push((width, 0.0));
    for z in [-half_depth, half_depth] {
        for pair in columns.windows(2) {
            let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
            let mut quad = [vec3(x0, y0, z), vec3(x1, y1, z), vec3(x1, height, z), vec3(x0, height, z)];
            if z < 0.0 {
                quad.reverse();
            }
            mesh.quad(quad);
        }
    }
    mesh
}

/// A point at `radius` from the y axis, `turn` (0…1) of the way around it.
fn around(turn: f32, radius: f32, y: f32) -> Vec3 {
    let (sin, cos) = (TAU * turn).sin_cos();
    vec3(radius * cos, y, -radius * sin)
}

/// The faces of a box, counter-clockwise from outside: −x, +x, −y, +y, −z, +z.
fn cuboid_faces(a: Vec3, b: Vec3) -> [[Vec3; 4]; 6] {
    let p = |x: f32, y: f32, z: f32| vec3(x, y, z);
    [
        [p(a.x, a.y, a.z), p(a.x, a.y, b.z), p(a.x, b.y, b.z), p(a.x, b.y, a.z)],
        [p(b.x, a.y, b.z), p(b.x, a.y, a.z), p(b.x, b.y, a.z), p(b.x, b.y, b.z)],
        [p(a.x, a.y, a.z), p(b.x, a.y, a.z), p(b.x, a.y, b.z), p(a.x, a.y, b.z)],
        [p(a.x, b.y, b.z), p(b.x, b.y, b.z), p(b.x, b.y, a.z), p(a.x, b.y, a.z)],
        [p(b.x, a.y, a.z), p(a.x, a.y, a.z), p(a.x, b.y, a.z), p(b.x, b.y, a.z)],
        [p(a.x, a.y, b.z), p(b.x, a.y, b.z), p(b.x, b.y, b.z), p(a.x, b.y, b.z)],
    ]
}

impl Scene {
    fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a mesh that stands where it was made.
    fn add(&mut self, mesh: Mesh) {
        self.add_at(mesh, [Mat4::IDENTITY]);
    }

    /// Adds a mesh with instances.
    fn add_at(&mut self, mesh: Mesh, places: impl IntoIterator<Item = Mat4>) {
        let mesh_index = self.meshes.len();
        self.meshes.push(mesh.into());
        self.instances
            .extend(places.into_iter().map(|world_from_object| Instance { mesh: mesh_index, world_from_object }));
    }
}

impl Mesh {
    fn new(name: &str, material: usize) -> Self {
        Self { name: name.to_owned(), material, ..Self::default() }
    }

    /// A flat four-sided face, counter-clockwise from the front. It may be a little out of plane: the normal is that
    /// of its mean plane.
    fn quad(&mut self, p: [Vec3; 4]) {
        let first = self.positions.len() as u32;
        let normal = (p[2] - p[0]).cross(p[3] - p[1]).normalize();
        self.positions.extend(p);
        self.normals.extend([normal; 4]);
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }

    /// A box, seen from outside.
    fn cuboid(&mut self, min: Vec3, max: Vec3) {
        for face in cuboid_faces(min, max) {
            self.quad(face);
        }
    }

    /// A smooth surface over `cells` cells of (u, v) in 0…1, with its front where ∂p/∂u × ∂p/∂v points. `closed`
    /// joins u = 1 to u = 0.
    fn grid(&mut self, cells: [usize; 2], closed: bool, point: impl Fn(f32, f32) -> Vec3) {
        let [nu, nv] = cells;
        let first = self.positions.len();
        let columns = if closed { nu } else { nu + 1 };
        for j in 0..=nv {
            for i in 0..columns {
                self.positions.push(point(i as f32 / nu as f32, j as f32 / nv as f32));
            }
        }
        self.normals.resize(self.positions.len(), Vec3::ZERO);
        for j in 0..nv {
            for i in 0..nu {
                let [a, b] = [i, (i + 1) % columns].map(|column| first + j * columns + column);
                for triangle in [[a, b, b + columns], [a, b + columns, a + columns]] {
                    let [p, q, r] = triangle.map(|k| self.positions[k]);
                    // Not normalised: large triangles count more. A triangle may have no area where cells meet in a
                    // point; it is left out.
                    let normal = (q - p).cross(r - p);
                    if normal.length() > 1e-9 {
                        triangle.iter().for_each(|&k| self.normals[k] += normal);
                        self.indices.extend(triangle.map(|k| k as u32));
                    }
                }
            }
        }
        for normal in &mut self.normals[first..] {
            *normal = normal.normalize_or(Vec3::Y);
        }
    }

    /// A smooth surface of revolution around the y axis, from (radius, y) points upwards.
    fn lathe(&mut self, segments: usize, profile: &[(f32, f32)]) {
        self.lathe_at(Vec3::ZERO, segments, profile);
    }

    /// A smooth surface of revolution around an upright axis through `foot`.
    fn lathe_at(&mut self, foot: Vec3, segments: usize, profile: &[(f32, f32)]) {
        let last = profile.len() - 1;
        self.grid([segments, last], true, |u, v| {
            let (radius, y) = profile[(v * last as f32).round() as usize];
            foot + around(u, radius, y)
        });
    }

    /// A square tile whose top is at `corner`'s height, with bevelled edges.
    fn tile(&mut self, corner: Vec3, size: f32, bevel: f32) {
        let square = |inset: f32, y: f32| {
            let (a, b) = (inset, size - inset);
            [vec3(a, y, a), vec3(a, y, b), vec3(b, y, b), vec3(b, y, a)].map(|p| corner + p)
        };
        let (top, edge) = (square(bevel, 0.0), square(0.0, -bevel));
        self.quad(top);
        for i in 0..4 {
            let j = (i + 1) % 4;
            self.quad([edge[i], edge[j], top[j], top[i]]);
        }
    }

    /// A slab between two heights with a rectangular hole: top, bottom and the hole's sides. `inner` and `outer` are
    /// half of its size along x and z; the outer sides are left out.
    fn ring(&mut self, heights: [f32; 2], inner: [f32; 2], outer: [f32; 2]) {
        let rectangle = |half: [f32; 2], y: f32| {
            let [x, z] = half;
            [vec3(-x, y, -z), vec3(-x, y, z), vec3(x, y, z), vec3(x, y, -z)]
        };
        let [below, above] = heights.map(|y| (rectangle(inner, y), rectangle(outer, y)));
        for i in 0..4 {
            let j = (i + 1) % 4;
            self.quad([above.0[i], above.1[i], above.1[j], above.0[j]]);
            self.quad([below.1[i], below.0[i], below.0[j], below.1[j]]);
            self.quad([below.0[j], below.0[i], above.0[i], above.0[j]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::Bvh;
    use crate::scene::defaults::tests::directly_lit;

    /// Directions spread evenly over the sphere (a Fibonacci lattice).
    fn directions(count: usize) -> impl Iterator<Item = Vec3> {
        (0..count).map(move |i| {
            let y = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
            let (sin, cos) = (i as f32 * PI * (3.0 - 5.0_f32.sqrt())).sin_cos();
            vec3((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin)
        })
    }

    #[test]
    fn rooms_are_closed_and_seen_from_within() {
        for scene in scenes() {
            let bvh = Bvh::new(&scene);
            let bounds = scene.bounds().unwrap();
            let open_in_front = scene.name == "builtin:cornell";
            let points = [("light", scene.lights[0].position), ("camera", scene.cameras[0].eye)];
            // The Cornell box's camera stands outside.
            for (what, point) in &points[..if open_in_front { 1 } else { 2 }] {
                let mut seen = 0.0;
                for direction in directions(2000) {
                    let Some(hit) = bvh.closest(*point, direction, 0.0, f32::INFINITY) else {
                        let exit = *point - direction * (point.z / direction.z);
                        let in_front = exit.cmpge(bounds.min).all() && exit.cmple(bounds.max).all();
                        assert!(open_in_front && direction.z < 0.0 && in_front, "{}: {what} {direction}", scene.name);
                        continue;
                    };
                    // Backs are seen of cloth alone: nobody stands within a column or wall.
                    let name = &scene.meshes[scene.instances[hit.instance].mesh].name;
                    let front = hit.normal.dot(direction) < 0.0 || name == "curtain";
                    assert!(front && hit.t > 0.005, "{}: {what} {direction} {name} {hit:?}", scene.name);
                    seen += hit.t / 2000.0;
                }
                assert!(seen > 0.1 * bounds.radius(), "{}: the {what} sees {seen} m", scene.name);
            }
        }
    }

    #[test]
    fn direct_light_is_what_each_scene_is_for() {
        for (name, allowed) in
            [("cornell", 0.5..0.9), ("column", 0.4..0.9), ("corridor", 0.05..0.4), ("atrium", 0.3..0.9)]
        {
            let share = directly_lit(&Scene::builtin(name).unwrap());
            assert!(allowed.contains(&share), "{name}: {share}");
        }
    }

    fn scenes() -> impl Iterator<Item = Scene> {
        BUILTIN_NAMES.into_iter().map(|(name, _)| Scene::builtin(name).unwrap())
    }

    #[test]
    fn counts() {
        let counts: Vec<usize> = scenes().map(|scene| scene.triangle_count()).collect();
        assert_eq!(counts[..3], [30, 268, 40]);
        assert!((190_000..210_000).contains(&counts[3]), "{}", counts[3]);
        let atrium = Scene::builtin("atrium").unwrap();
        let shared = (0..atrium.meshes.len()).map(|m| atrium.instances.iter().filter(|i| i.mesh == m).count()).max();
        assert!(shared >= Some(44), "{shared:?}");
    }

    #[test]
    fn an_unknown_name_is_refused_with_those_that_are_known() {
        let error = Scene::builtin("teapot").unwrap_err();
        assert!(error.is_bad_input());
        let text = error.to_string();
        assert!(text.contains("teapot") && BUILTIN_NAMES.iter().all(|(name, _)| text.contains(name)), "{text}");
    }

    #[test]
    fn scenes_are_well_formed() {
        for scene in scenes() {
            assert!(scene.name.starts_with("builtin:") && scene.lights.len() == 1 && scene.cameras.len() == 1);
            assert!(scene.instances.iter().all(|instance| instance.mesh < scene.meshes.len()));
            for mesh in &scene.meshes {
                assert!(mesh.material < scene.materials.len() && mesh.positions.len() == mesh.normals.len());
                assert!(mesh.positions.iter().all(|p| p.is_finite()));
                assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
                for triangle in mesh.indices.as_chunks::<3>().0 {
                    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
                    let normal = (b - a).cross(c - a);
                    assert!(normal.length() > 1e-9, "{} {}: no area", scene.name, mesh.name);
                    for i in triangle {
                        let dot = normal.normalize().dot(mesh.normals[*i as usize]);
                        assert!(dot > 0.0, "{} {}: {dot}", scene.name, mesh.name);
                    }
                }
            }
        }
    }

    #[test]
    fn the_cornell_box_has_its_published_size() {
        let scene = Scene::builtin("cornell").unwrap();
        let bounds = scene.bounds().unwrap();
        assert!(
            (bounds.min - Vec3::ZERO).length() < 1e-6 && (bounds.max - vec3(0.556, 0.5488, 0.5592)).length() < 1e-6
        );
        let area = |name: &str| -> f32 {
            let mesh = scene.meshes.iter().find(|mesh| mesh.name == name).unwrap();
            let triangles = mesh.indices.as_chunks::<3>().0.iter();
            triangles
                .map(|t| {
                    let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                    0.5 * (b - a).cross(c - a).length()
                })
                .sum()
        };
        // Trapezoids of (552.8 + 549.6)/2 × 559.2 and 556.0 × 559.2 mm; a block's top is about 165 × 165 mm.
        assert!((area("floor") - 0.5512 * 0.5592).abs() < 1e-6);
        assert!((area("ceiling") - 0.556 * 0.5592).abs() < 1e-6);
        assert!((area("right wall") - 0.5488 * 0.5592).abs() < 1e-6);
        assert!((area("short block") - (0.165 * 0.165 + 4.0 * 0.165 * 0.166)).abs() < 2e-3);
        assert!((area("tall block") - (0.165 * 0.165 + 4.0 * 0.165 * 0.330)).abs() < 4e-3);

        // Red stands on the left of the picture, green on the right, and the normals look inward.
        let view = scene.cameras[0].view_from_world();
        for (name, side, normal) in [("left wall", -1.0, Vec3::NEG_X), ("right wall", 1.0, Vec3::X)] {
            let mesh = scene.meshes.iter().find(|mesh| mesh.name == name).unwrap();
            assert!(mesh.positions.iter().all(|&p| view.transform_point3(p).x * side > 0.0), "{name}");
            assert!(mesh.normals[0].dot(normal) > 0.99, "{name}");
        }
    }
}
