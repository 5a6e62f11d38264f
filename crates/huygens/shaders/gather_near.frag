// The sum over the near VPLs of a range: see common/near.glsl. At the pixels that pass the depth test where
// accumulate_near.frag was drawn, else at all.
// Inputs: G-buffer, VPL texture, lists of near VPLs, visibility, with near_cells.w what there is. Outputs: irradiance,
// W/m², and in alpha 0: it is of this frame, see common/near_before.glsl; reflected radiance, W/(m² sr).

uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    o_irradiance = vec4(0.0);
    o_specular = vec4(0.0);
    if (near_cells.w != 0) {
        o_irradiance = texelFetch(s_previous, pixel, 0);
        o_specular = texelFetch(s_previous_specular, pixel, 0);
    }
    sum_near(pixel, o_irradiance, o_specular);
}
