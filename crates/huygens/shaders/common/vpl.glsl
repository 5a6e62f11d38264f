// The VPL texture: four texels for each VPL, 512 VPLs in a row. `vpl.rs` writes it.

uniform sampler2D s_vpl;

struct Vpl {
    vec3 position_ws;  // m
    float d_min;       // m, distance below which it gets no brighter; radius of a disc as large as a Lambertian one's patch
    vec3 direction_ws; // unit; the side that gets full radiance
    bool lambertian;   // cosine in front and nothing behind, else full in front and half behind
    float reach;       // share of `near` within which it is summed apart, 0 if it is in no list of near VPLs
    vec3 intensity;    // W/sr, along the direction
    float near;        // m, distance within which a Lambertian one is its rectangle
};

Vpl read_vpl(int i)
{
    ivec2 texel = ivec2((i & 511) * 4, i >> 9);
    vec4 position = texelFetch(s_vpl, texel, 0), direction = texelFetch(s_vpl, texel + ivec2(1, 0), 0);
    vec4 intensity = texelFetch(s_vpl, texel + ivec2(2, 0), 0);
    return Vpl(position.xyz, position.w, direction.xyz, direction.w > 0.5, max(direction.w - 1.0, 0.0), intensity.xyz, intensity.w);
}

// How far the rectangle that a Lambertian VPL stands for goes along −x, x, −y and y of its frame, m.
vec4 read_vpl_extent(int i)
{
    return texelFetch(s_vpl, ivec2((i & 511) * 4 + 3, i >> 9), 0);
}
