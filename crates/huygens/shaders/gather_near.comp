// The sum over the near VPLs of a range at every pixel, added to what there is, as gather_near.frag has it: see
// common/near.glsl. Lists are each pixel's own: a workgroup is pixels that lie together, whose lists are often the same.
// Inputs: as those of gather_near.frag. Outputs: as those of gather.comp.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32f, binding = 1) uniform writeonly image2D i_specular;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(i_irradiance)))) {
        vec4 irradiance, specular;
        sum_near(pixel, irradiance, specular);
        imageStore(i_irradiance, pixel, irradiance);
        imageStore(i_specular, pixel, specular);
    }
}
