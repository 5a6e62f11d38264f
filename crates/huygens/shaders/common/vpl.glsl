// The VPL texture: four texels for each VPL, 512 VPLs in a row. `vpl.rs` writes it.

uniform sampler2D s_vpl;

struct Vpl {
    vec3 position_ws;  // m
    float d_min;       // m, distance below which it gets no brighter; radius of a disc as large as a Lambertian one's patch
    vec3 direction_ws; // unit; the side that gets full radiance
    bool lambertian;   // cosine in front and nothing behind, else full in front and half behind
    float reach;       // m, distance within which it is summed apart, 0 if it is in no list of near VPLs
    vec3 intensity;    // W/sr, along the direction
    float near;        // m, distance within which a Lambertian one is its rectangle, else 0
};

// The first of a VPL's texels.
ivec2 vpl_texel(int i)
{
    return ivec2((i & 511) * 4, i >> 9);
}

// A VPL from its first three texels.
Vpl unpack_vpl(vec4 position, vec4 direction, vec4 intensity)
{
    return Vpl(position.xyz, intensity.w, direction.xyz, direction.w >= 0.0, position.w, intensity.xyz, max(direction.w, 0.0));
}

Vpl read_vpl(int i)
{
    ivec2 texel = vpl_texel(i);
    return unpack_vpl(texelFetch(s_vpl, texel, 0), texelFetch(s_vpl, texel + ivec2(1, 0), 0),
                      texelFetch(s_vpl, texel + ivec2(2, 0), 0));
}

// How far the rectangle that a Lambertian VPL stands for goes along −x, x, −y and y of its frame, m.
vec4 read_vpl_extent(int i)
{
    return texelFetch(s_vpl, vpl_texel(i) + ivec2(3, 0), 0);
}
