// The VPL texture: three texels for each VPL, 512 VPLs in a row. `vpl.rs` writes it.

uniform sampler2D s_vpl;

struct Vpl {
    vec3 position_ws;  // m
    vec3 direction_ws; // unit; the side that gets full radiance
    vec3 intensity;    // W/sr
};

vec3 vpl_position(int i)
{
    return texelFetch(s_vpl, ivec2((i & 511) * 3, i >> 9), 0).xyz;
}

Vpl read_vpl(int i)
{
    ivec2 texel = ivec2((i & 511) * 3, i >> 9);
    return Vpl(texelFetch(s_vpl, texel, 0).xyz,
               texelFetch(s_vpl, texel + ivec2(1, 0), 0).xyz,
               texelFetch(s_vpl, texel + ivec2(2, 0), 0).xyz);
}
