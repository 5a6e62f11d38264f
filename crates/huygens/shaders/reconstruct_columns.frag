// The filter of the interleaved gather along columns: see common/reconstruct.glsl. What is known for every pixel is added.
// Inputs: G-buffer, means filtered along rows, means, sums of every pixel. Outputs: irradiance, W/m², with the sum of the
// weights in alpha, and reflected radiance, W/(m² sr).

uniform sampler2D s_sum;
uniform sampler2D s_sum_specular;

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
    reconstruct(pixel, texelFetch(s_surface, pixel, 0), o_irradiance, reflected);
    o_irradiance.rgb += texelFetch(s_sum, pixel, 0).rgb;
    o_specular = vec4(reflected + texelFetch(s_sum_specular, pixel, 0).rgb, 0.0);
}
