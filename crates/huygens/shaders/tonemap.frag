// From linear values to a display: exposure, tone mapping, sRGB.

uniform sampler2D s_value;

layout(std140) uniform PassBlock {
    uvec4 kind; // x: 0 radiance, 1 colour, 2 normal, 3 depth
    vec4 scale; // x: factor on the value before anything else
};

layout(location = 0) out vec4 o_color;

void main()
{
    vec3 value = min(texelFetch(s_value, ivec2(gl_FragCoord.xy), 0).rgb * scale.x, 1e15);
    vec3 color = kind.x == 0u ? srgb_from_linear(pbr_neutral(value))
               : kind.x == 1u ? srgb_from_linear(value)
               : kind.x == 2u ? (dot(value, value) > 0.0 ? value * 0.5 + 0.5 : vec3(0.0))
               : clamp(value, 0.0, 1.0);
    o_color = vec4(color, 1.0);
}
