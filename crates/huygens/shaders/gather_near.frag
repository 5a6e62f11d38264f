// The sum over the near VPLs of a range: see common/near.glsl. At the pixels that pass the depth test where
// accumulate_near.frag was drawn, else at all.
// Inputs: G-buffer, VPL texture, lists of near VPLs, visibility, with near_cells.w what there is. Outputs: near sums
// (common/mean.glsl) of 0 frames: they are of this one.

uniform highp usampler2D s_previous;

layout(location = 0) out uvec4 o_sum;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    NearSum sum = NearSum(vec3(0.0), vec3(0.0), 0u);
    if (near_cells.w != 0) {
        sum = unpack_near(texel_at(s_previous, pixel, size.zw));
    }
    sum_near(pixel, sum);
    o_sum = pack_near(sum);
}
