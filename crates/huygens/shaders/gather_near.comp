// The sum over the near VPLs of a range at every pixel, added to what there is: of the ranges before, or, and then that is
// all of it, of the frame before. See common/near.glsl and common/near_before.glsl. Lists are each pixel's own: a workgroup is
// pixels that lie together, whose lists are often the same. Inputs: as those of gather_near.frag. Outputs: as
// those of gather.comp, with the frames since the light was summed, see there.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32f, binding = 1) uniform writeonly image2D i_specular;

uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(i_irradiance)))) {
        vec4 irradiance = texelFetch(s_previous, pixel, 0), specular = texelFetch(s_previous_specular, pixel, 0);
        if (irradiance.a == 0.0) {
            sum_near(pixel, irradiance, specular);
        }
        imageStore(i_irradiance, pixel, irradiance);
        imageStore(i_specular, pixel, specular);
    }
}
