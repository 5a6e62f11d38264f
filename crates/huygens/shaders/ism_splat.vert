// Imperfect shadow maps (Ritschel et al. 2008): every VPL splats its own random subset of the scene's surfels into
// its octahedral tile. The surfels stand in an order in which neighbours are near each other; each VPL takes one at
// random out of every run of `stride`, so that its subset covers the scene evenly. A surfel stands for a disc. Of a run
// that is near it takes several, one out of each part, whose discs are as much smaller.

layout(std140) uniform PassBlock {
    uvec4 counts; // x: points of a VPL, y: stride, z: first VPL, w: seed
    uvec4 atlas;  // x: texels on a tile's edge, y: tiles in a row, z: points that stand for one that is near
    vec4 disc;    // x: radius of a disc, m; y: 1 / farthest distance that the maps hold; z: largest point, pixels
    vec4 target_size; // xy: texels of the atlas
};

// Four texels for each surfel: position (m), normal, and twice the vector across an edge at which the surface ends
// (w: the distance to it, m); 512 surfels in a row.
uniform sampler2D s_surfel;

// In the space of the tile:
flat out ivec2 v_tile;    // first texel of the tile
flat out int v_hemisphere;
flat out vec3 v_offset;   // surfel − VPL, m
flat out vec3 v_normal;
flat out vec4 v_edge_a;
flat out vec4 v_edge_b;
flat out float v_radius;  // of the disc, m

// Of a disc's radius over its distance, times the texels on a tile's edge: what is beyond counts as near.
const float NEAR = 8.0;

// PCG (Jarzynski & Olano 2020, "Hash functions for GPU rendering").
uint hash(uint x)
{
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

void main()
{
    uint id = uint(gl_VertexID);
    uint vpl = counts.z + id / (counts.x * atlas.z), part = id % atlas.z, point = id / atlas.z % counts.x;
    uint pick = hash(point ^ hash(vpl ^ hash(counts.w))) % counts.y;
    int surfel = int(point * counts.y + pick);
    ivec2 texel = ivec2((surfel & 511) * 4, surfel >> 9);
    Vpl v = read_vpl(int(vpl));
    bool near = disc.x * float(atlas.x) > NEAR * distance(texelFetch(s_surfel, texel, 0).xyz, v.position_ws);
    v_radius = disc.x;
    if (part > 0u && !near) {
        // One stands for itself.
        v_tile = ivec2(0);
        v_hemisphere = 0;
        v_offset = vec3(0.0);
        v_normal = vec3(0.0);
        v_edge_a = vec4(0.0);
        v_edge_b = vec4(0.0);
        gl_Position = vec4(2.0, 2.0, 0.0, 1.0);
        gl_PointSize = 1.0;
        return;
    }
    if (near) {
        uint stride = counts.y / atlas.z;
        surfel = int(point * counts.y + part * stride + pick % stride);
        texel = ivec2((surfel & 511) * 4, surfel >> 9);
        v_radius *= inversesqrt(float(atlas.z));
    }
    mat3 to_tile = tile_from_world(v.direction_ws, v.lambertian);
    vec4 edge_a = texelFetch(s_surfel, texel + ivec2(2, 0), 0), edge_b = texelFetch(s_surfel, texel + ivec2(3, 0), 0);
    v_offset = to_tile * (texelFetch(s_surfel, texel, 0).xyz - v.position_ws);
    v_normal = to_tile * texelFetch(s_surfel, texel + ivec2(1, 0), 0).xyz;
    v_edge_a = vec4(to_tile * edge_a.xyz, edge_a.w);
    v_edge_b = vec4(to_tile * edge_b.xyz, edge_b.w);
    v_tile = ivec2(int(vpl % atlas.y), int(vpl / atlas.y)) * int(atlas.x);
    v_hemisphere = v.lambertian ? 1 : 0;

    vec2 at = vec2(v_tile) + tile_encode(v_offset, v.lambertian) * float(atlas.x);
    // Clipped: a disc that is all behind a hemisphere; and one with its centre there that faces away, as those of the
    // VPL's own surface do where that bends away: what rises of it into the hemisphere is not there.
    bool away = v_offset.z <= 0.0 && dot(v_normal, v_offset) > 0.0;
    bool unseen = v_offset == vec3(0.0) || v.lambertian && (away || v_offset.z < -v_radius);
    gl_Position = vec4(unseen ? vec2(2.0) : at / target_size.xy * 2.0 - 1.0, 0.0, 1.0);
    // Where the octahedral map stretches most (along x or y, which bounds a square), a radian has √½ of a tile, and √5/2
    // of a hemisphere's. The fragment shader cuts the disc out exactly.
    float angle = asin(min(v_radius / max(length(v_offset), 1e-30), 1.0));
    float texels = 2.0 * angle * (v.lambertian ? 1.118034 : 0.70710678) * float(atlas.x);
    gl_PointSize = clamp(texels, 1.0, min(disc.z, 2.0 * float(atlas.x)));
}
