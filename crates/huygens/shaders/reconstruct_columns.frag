// The filter of the interleaved gather along columns: see common/reconstruct.glsl. What is known for every pixel is added.
// Inputs: G-buffer, means filtered along rows, near sums. Outputs: irradiance, W/m², with the sum of the
// weights in alpha, and reflected radiance, W/(m² sr).

uniform highp usampler2D s_near_sum;

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

Tap tap_at(ivec2 cell)
{
    return read_tap(cell);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 reflected;
    reconstruct(pixel, texel_at(s_surface, pixel, size.zw), o_irradiance, reflected);
    NearSum near = unpack_near(texel_at(s_near_sum, pixel, size.zw));
    o_irradiance.rgb += near.irradiance;
    o_specular = vec4(reflected + near.reflected, 0.0);
}
