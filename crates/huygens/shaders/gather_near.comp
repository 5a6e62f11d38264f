// The sum over the near VPLs of a range at every pixel, added to what there is: of the ranges before, or, and then that is
// all of it, of the frame before. See common/near.glsl and common/near_before.glsl. Lists are each pixel's own: a workgroup is
// pixels that lie together, whose lists are often the same. Inputs: as those of gather_near.frag. Outputs: as
// those of gather.comp, with the frames since the light was summed, see there.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32ui, binding = 0) uniform writeonly uimage2D i_sum;

uniform usampler2D s_previous;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(i_sum)))) {
        NearSum sum = NearSum(vec3(0.0), vec3(0.0), 0u);
        if (near_cells.w != 0) {
            sum = unpack_near(texel_at(s_previous, pixel, size.zw));
        }
        if (sum.frames == 0u) {
            sum_near(pixel, sum);
        }
        imageStore(i_sum, pixel, pack_near(sum));
    }
}
