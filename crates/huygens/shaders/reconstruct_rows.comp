// The filter of the interleaved gather along rows, as reconstruct_rows.frag has it: see common/reconstruct.glsl.
// Inputs: G-buffer, means. Outputs: such means, common/mean.glsl, with the sum of the weights in alpha.

layout(local_size_x = 128) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32ui, binding = 1) uniform writeonly uimage2D i_surface;

void main()
{
    ivec2 at = fetch_taps();
    if (all(lessThan(at, cell_count()))) {
        ivec2 pixel = pixel_of(at);
        uvec4 texel = texel_at(s_surface, pixel, size.zw);
        vec4 irradiance;
        vec3 reflected;
        reconstruct(pixel, texel, irradiance, reflected);
        imageStore(i_irradiance, at, irradiance);
        imageStore(i_surface, at, uvec4(texel.xy, pack_radiance(reflected)));
    }
}
