// The sum over the near VPLs of a range at every pixel, added to what there is: see common/near.glsl.
// Inputs: G-buffer and the surfaces before, VPL texture, lists of near VPLs, visibility, sums before. Outputs: as those of
// gather.frag.

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    sum_near(ivec2(gl_FragCoord.xy), o_irradiance, o_specular);
}
