// The mean over frames of what the interleaved gather sums, as accumulate.frag has it: see common/accumulate.glsl.
// Inputs: G-buffer, sums, the means before. Outputs: means, as common/mean.glsl has them, with the number of frames.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32ui, binding = 1) uniform writeonly uimage2D i_surface;

void keep(float share, ivec2 inside) {}

void main()
{
    ivec2 cell = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(cell, imageSize(i_irradiance)))) {
        vec4 irradiance;
        uvec4 surface;
        accumulate(cell, irradiance, surface);
        imageStore(i_irradiance, cell, irradiance);
        imageStore(i_surface, cell, surface);
    }
}
