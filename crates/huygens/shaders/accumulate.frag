// The mean over frames of what the interleaved gather sums: see common/accumulate.glsl.
// Inputs: G-buffer, sums, the means before. Outputs: means, as common/mean.glsl has them, with the number of frames.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out uvec4 o_surface;

void keep(float share, ivec2 inside) {}

void main()
{
    accumulate(ivec2(gl_FragCoord.xy), o_irradiance, o_surface);
}
