// What near VPLs gave in the frame before: see common/near_before.glsl. Inputs: surfaces now and before, sums before.
// Outputs: as those of gather_near.frag; depth, in front of what is drawn next where nothing is left to sum. Many drivers
// skip what fails a depth test, but not what follows a branch that no lane takes.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    near_before(pixel, o_irradiance, o_specular);
    bool sky = uintBitsToFloat(texelFetch(s_surface, pixel, 0).x) <= 0.0;
    gl_FragDepth = sky || o_irradiance.a > 0.0 ? 0.0 : 0.75;
}
