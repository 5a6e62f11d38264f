// Where a point of a surface was in the frame before, and which pixels showed that surface then (reverse reprojection:
// Nehab et al. 2007, "Accelerating real-time shading with reverse reprojection caching").

uniform highp usampler2D s_mean_surface;

// `passes/accumulate.rs` mirrors the block.
layout(std140) uniform BeforeBlock {
    mat4 previous_view_from_world;
    vec4 previous_unprojection;
    vec4 previous_jitter;
    vec4 previous_scale; // what the means before are multiplied by: how much brighter all VPLs together are now
    ivec4 cells;  // x, y: binary logarithms of n and of the pixels from one that has a mean to the next, zw: size of a layer of sums
    vec4 scales;  // reciprocals of the sizes of, xy: what has means, zw: sums
    uvec4 count;  // x: most frames that the mean before may count for, 0 if there is none; y: 1 if nothing moved; z: 1 if objects did; w: number of subsets
    uvec4 renew;  // xy: which of eight kinds of blocks of pixels have their near sums made anew, for near_before.glsl
};

// The pixel whose mean a cell has. (Integers are shifted, not divided: a division of each lane by itself takes long.)
ivec2 pixel_of(ivec2 cell)
{
    return min((cell << cells.y) + ((1 << cells.y) >> 1), ivec2(size.xy) - 1);
}

// A point of a surface as the camera before saw it.
struct Before {
    bool seen;     // whether it was before that camera
    vec2 at;       // cells
    vec3 position; // m
    vec3 plane;    // unit
    vec3 normal;   // unit, world space
    float near;    // m, what rounding may move it by
};

// From what is now in a cell: its place where it was then, m, and normals, world space. `near` see above.
Before before(ivec2 cell, vec3 position, vec3 normal, vec3 plane, float near)
{
    Before b;
    b.near = near;
    b.normal = normal;
    b.position = (previous_view_from_world * vec4(position, 1.0)).xyz;
    b.plane = mat3(previous_view_from_world) * plane;
    float spread = previous_unprojection.z - previous_unprojection.w * b.position.z;
    b.seen = spread > 0.0 || count.y == 1u;
    vec2 at = ((b.position.xy / (previous_unprojection.xy * spread) - previous_jitter.xy) * 0.5 + 0.5) * size.xy - 0.5;
    float step = float(1 << cells.y);
    at = (at - floor(0.5 * step)) / step;
    // What is still keeps its mean to the last digit.
    b.at = count.y == 1u ? vec2(cell) : clamp(at, vec2(-2.0), size.xy + 2.0);
    return b;
}

// How much the k-th of the four cells around the point counts, and what it was of: 0 if it was of another surface.
float share_of(Before b, int k, out ivec2 inside, out uvec4 texel)
{
    vec2 low = floor(b.at), part = b.at - low;
    ivec2 corner = ivec2(k & 1, k >> 1), cell = ivec2(low) + corner;
    vec2 shares = mix(1.0 - part, part, vec2(corner));
    ivec2 end = ((ivec2(size.xy) - 1) >> cells.y) + 1;
    inside = clamp(cell, ivec2(0), end - 1);
    texel = texel_at(s_mean_surface, inside, scales.xy);
    float depth = uintBitsToFloat(texel.x);
    vec2 ndc = (vec2(pixel_of(cell)) + 0.5) * size.zw * 2.0 - 1.0 + previous_jitter.xy;
    vec2 ray = ndc * previous_unprojection.xy * (previous_unprojection.z + previous_unprojection.w * depth);
    vec3 d = vec3(ray, -depth) - b.position;
    bool same = abs(dot(b.plane, d)) <= 0.05 * length(d) + b.near && dot(b.normal, oct_decode(unpack_pair(texel.y))) >= 0.9;
    // Where nothing moved since, rounding is all that differs, and how things moved before.
    bool counts = cell == inside && depth > 0.0 && (same || count.y == 1u);
    return counts ? shares.x * shares.y : 0.0;
}
