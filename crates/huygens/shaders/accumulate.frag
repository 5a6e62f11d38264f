// The mean over frames of what the interleaved gather sums: see common/accumulate.glsl.
// Inputs: G-buffer, sums, the means before with the surfaces that they belong to. Outputs: mean irradiance, W/m², with the
// number of frames in alpha; mean reflected radiance, W/(m² sr); the surface, packed as in the G-buffer.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;
layout(location = 2) out uvec4 o_surface;

void main()
{
    accumulate(ivec2(gl_FragCoord.xy), o_irradiance, o_specular, o_surface);
}
