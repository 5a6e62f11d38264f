// The filter of the interleaved gather along columns, as reconstruct_columns.frag has it: see common/reconstruct.glsl. What
// is known for every pixel is added.
// Inputs: G-buffer, means filtered along rows, near sums. Outputs: irradiance, W/m², with the sum of the
// weights in alpha, and reflected radiance, W/(m² sr).

layout(local_size_x = 128) in;

layout(rgba32f, binding = 0) uniform writeonly image2D i_irradiance;
layout(rgba32f, binding = 1) uniform writeonly image2D i_specular;

uniform highp usampler2D s_near_sum;

void main()
{
    ivec2 at = fetch_taps();
    if (all(lessThan(at, ivec2(size.xy)))) {
        vec4 irradiance;
        vec3 reflected;
        reconstruct(at, texel_at(s_surface, at, size.zw), irradiance, reflected);
        NearSum near = unpack_near(texel_at(s_near_sum, at, size.zw));
        imageStore(i_irradiance, at, irradiance + vec4(near.irradiance, 0.0));
        imageStore(i_specular, at, vec4(reflected + near.reflected, 0.0));
    }
}
