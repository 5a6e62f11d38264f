// The sum over the near VPLs of a range at every pixel, added to what other ranges gave, as gather_near.frag has it: see
// common/near.glsl. Lists are each pixel's own: a workgroup is pixels that lie together, whose lists are often the same.
// Inputs: G-buffer, VPL texture, lists of near VPLs, visibility. Outputs: as those of gather.comp.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform image2D i_irradiance;
layout(rgba32f, binding = 1) uniform image2D i_specular;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    Receiver r;
    if (read_receiver(pixel, r)) {
        vec3 diffuse = vec3(0.0), specular = vec3(0.0);
        add_near(r, diffuse, specular);
        imageStore(i_irradiance, pixel, imageLoad(i_irradiance, pixel) + vec4(diffuse, 0.0));
        imageStore(i_specular, pixel, imageLoad(i_specular, pixel) + vec4(specular, 0.0));
    }
}
