// The mean over frames of what the interleaved gather sums, and what near VPLs gave in the frame before, as
// accumulate_near.frag has them: see common/accumulate.glsl and common/near_before.glsl.
// Inputs: as those of accumulate.comp, near sums before. Outputs: as those of accumulate.comp; as those of gather_near.comp.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32ui, binding = 1) uniform writeonly uimage2D i_surface;
layout(rgba32ui, binding = 2) uniform writeonly uimage2D i_near;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(i_irradiance)))) {
        vec4 irradiance;
        uvec4 surface;
        accumulate(pixel, irradiance, surface);
        imageStore(i_irradiance, pixel, irradiance);
        imageStore(i_surface, pixel, surface);
        imageStore(i_near, pixel, pack_near(near_before(pixel)));
    }
}
