// One direction of the filter of the interleaved gather: see common/reconstruct.glsl.
// Inputs: G-buffer, means, sums of every pixel. Outputs: irradiance, W/m², with the sum of the weights in alpha, and
// reflected radiance, W/(m² sr).

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

Tap tap_at(ivec2 cell)
{
    return read_tap(cell);
}

void main()
{
    reconstruct(ivec2(gl_FragCoord.xy), o_irradiance, o_specular);
}
