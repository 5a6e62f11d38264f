// The filter of the interleaved gather along rows: see common/reconstruct.glsl.
// Inputs: G-buffer, means. Outputs: such means, common/mean.glsl, with the sum of the weights in alpha.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out uvec4 o_surface;

Tap tap_at(ivec2 cell)
{
    return read_tap(cell);
}

void main()
{
    ivec2 pixel = pixel_of(ivec2(gl_FragCoord.xy));
    uvec4 texel = texel_at(s_surface, pixel, size.zw);
    vec3 reflected;
    reconstruct(pixel, texel, o_irradiance, reflected);
    o_surface = uvec4(texel.xy, pack_radiance(reflected));
}
