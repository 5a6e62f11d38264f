// What near VPLs gave in the frame before: see common/near_before.glsl. Inputs: surfaces now and before, sums before.
// Outputs: as those of gather_near.frag; depth, in front of what is drawn next where nothing is left to sum. What fails a
// depth test is skipped, also by drivers without hardware that run both sides of every branch.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    near_before(pixel, o_irradiance, o_specular);
    // full_screen.vert draws at 0.5.
    gl_FragDepth = read_depth(pixel) <= 0.0 || o_irradiance.a > 0.0 ? 0.0 : 0.75;
}
