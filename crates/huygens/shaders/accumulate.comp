// The mean over frames of what the interleaved gather sums, as accumulate.frag has it: see common/accumulate.glsl.
// Inputs: G-buffer, sums, the means before with the surfaces that they belong to. Outputs: mean irradiance, W/m², with the
// number of frames in alpha; mean reflected radiance, W/(m² sr); the surface, packed as in the G-buffer.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32f, binding = 1) uniform writeonly image2D i_specular;
layout(rgba32ui, binding = 2) uniform writeonly uimage2D i_surface;

void main()
{
    ivec2 cell = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(cell, imageSize(i_irradiance)))) {
        vec4 irradiance, specular;
        uvec4 surface;
        accumulate(cell, irradiance, specular, surface);
        imageStore(i_irradiance, cell, irradiance);
        imageStore(i_specular, cell, specular);
        imageStore(i_surface, cell, surface);
    }
}
