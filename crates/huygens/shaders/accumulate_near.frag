// The mean over frames of what the interleaved gather sums, and what near VPLs gave in the frame before: see
// common/accumulate.glsl and common/near_before.glsl. Both are of the same pixels then.
// Inputs: as those of accumulate.frag, near sums before. Outputs: as those of accumulate.frag; as those of gather_near.frag;
// depth, in front of what is drawn next where nothing is left to sum. What fails a depth test is skipped, also by drivers
// without hardware that run both sides of every branch.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out uvec4 o_surface;
layout(location = 2) out uvec4 o_near;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    accumulate(pixel, o_irradiance, o_surface);
    NearSum near = near_before(pixel);
    o_near = pack_near(near);
    // full_screen.vert draws at 0.5.
    gl_FragDepth = uintBitsToFloat(o_surface.x) <= 0.0 || near.frames > 0u ? 0.0 : 0.75;
}
