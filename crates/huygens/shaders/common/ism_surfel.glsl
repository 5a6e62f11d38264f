// Which surfels a VPL splats. They stand in an order in which neighbours are near each other; each VPL takes one at
// random out of every run of `stride`, so that its subset covers the scene evenly. Of a run that is near it takes
// several, one out of each part, whose discs are as much smaller.

// Four texels for each surfel: position (m), normal, and twice the vector across an edge at which the surface ends
// (w: the distance to it, m); 512 surfels in a row. In w of the first two is the vector along which the surface bends most,
// as long as the root of the curvature, 1/m; where the first is less than 0, it bends so in all directions, and where it is 0, it is flat.
uniform sampler2D s_surfel;

// Of a disc's radius over its distance, times the texels on a tile's edge: what is beyond counts as near.
const float NEAR = 8.0;

// Of the radius of those smaller discs: a flat surface whose plane is no farther has whole discs, because a hole between
// smaller ones would be most of what there is to see.
const float CLOSE = 0.25;

// PCG (Jarzynski & Olano 2020, "Hash functions for GPU rendering").
uint hash(uint x)
{
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

// In the space of the tile; the axes across the normal are those of Duff et al. 2017.
vec4 bend_of(mat3 to_tile, vec3 n, vec2 bend)
{
    if (bend.x <= 0.0) {
        return vec4(0.0, 0.0, 0.0, bend.x * bend.x);
    }
    float side = n.z >= 0.0 ? 1.0 : -1.0, a = -1.0 / (side + n.z), b = n.x * n.y * a;
    vec3 x = vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    return vec4(to_tile * (x * bend.x + vec3(b, side + n.y * n.y * a, -n.y) * bend.y), 0.0);
}

// One of the splats of a VPL, `id` < points × points that stand for a near one: its place in the tile, texels, and the
// edge of a square around it that holds its disc. False where there is none.
bool read_splat(uint vpl, Vpl v, uint id, out Splat splat, out vec2 at, out float texels)
{
    uint part = id % atlas.z, point = id / atlas.z;
    uint pick = hash(point ^ hash(vpl ^ hash(counts.w))) % counts.y;
    int surfel = int(point * counts.y + pick);
    ivec2 texel = ivec2((surfel & 511) * 4, surfel >> 9);
    vec4 position = texelFetch(s_surfel, texel, 0);
    bool near = disc.x * float(atlas.x) > NEAR * distance(position.xyz, v.position_ws);
    // One stands for itself.
    if (part > 0u && !near) {
        return false;
    }
    splat.radius = disc.x;
    if (near) {
        uint stride = counts.y / atlas.z;
        surfel = int(point * counts.y + part * stride + pick % stride);
        texel = ivec2((surfel & 511) * 4, surfel >> 9);
        position = texelFetch(s_surfel, texel, 0);
    }
    mat3 to_tile = tile_from_world(v.direction_ws, v.lambertian);
    vec4 edge_a = texelFetch(s_surfel, texel + ivec2(2, 0), 0), edge_b = texelFetch(s_surfel, texel + ivec2(3, 0), 0);
    splat.hemisphere = v.lambertian;
    splat.offset = to_tile * (position.xyz - v.position_ws);
    vec4 normal = texelFetch(s_surfel, texel + ivec2(1, 0), 0);
    if (near) {
        float height = abs(dot(normal.xyz, position.xyz - v.position_ws));
        float part_radius = disc.x * inversesqrt(float(atlas.z));
        splat.radius = position.w == 0.0 && height < CLOSE * part_radius ? disc.x : part_radius;
    }
    splat.normal = to_tile * normal.xyz;
    splat.bend = bend_of(to_tile, normal.xyz, vec2(position.w, normal.w));
    splat.edge_a = vec4(to_tile * edge_a.xyz, edge_a.w);
    splat.edge_b = vec4(to_tile * edge_b.xyz, edge_b.w);

    // Unseen: a disc that is all behind a hemisphere; and one with its centre there that faces away, as those of the
    // VPL's own surface do where that bends away: what rises of it into the hemisphere is not there.
    bool away = splat.offset.z <= 0.0 && dot(splat.normal, splat.offset) > 0.0;
    if (splat.offset == vec3(0.0) || v.lambertian && (away || splat.offset.z < -splat.radius)) {
        return false;
    }
    at = tile_encode(splat.offset, v.lambertian) * float(atlas.x);
    // Where the octahedral map stretches most (along x or y, which bounds a square), a radian has √½ of a tile, and √5/2
    // of a hemisphere's.
    float angle = asin(min(splat.radius / max(length(splat.offset), 1e-30), 1.0));
    texels = 2.0 * angle * (v.lambertian ? 1.118034 : 0.70710678) * float(atlas.x);
    texels = clamp(texels, 1.0, 2.0 * float(atlas.x));
    return true;
}
