// From linear values to a display: exposure, tone mapping, sRGB.

uniform sampler2D s_value;

layout(std140) uniform PassBlock {
    uvec4 kind; // x: 0 radiance, 1 colour, 2 normal, 3 depth
    vec4 scale; // x: factor on the value before anything else
};

layout(location = 0) out vec4 o_color;

// Khronos PBR Neutral tone mapper (2024): hue and saturation of base colours stay, highlights are compressed.
vec3 pbr_neutral(vec3 color)
{
    const float start = 0.8 - 0.04, desaturation = 0.15;
    float low = min(color.r, min(color.g, color.b));
    color -= low < 0.08 ? low - 6.25 * low * low : 0.04;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < start) {
        return color;
    }
    const float d = 1.0 - start;
    float compressed = 1.0 - d * d / (peak + d - start);
    float grey = 1.0 - 1.0 / (desaturation * (peak - compressed) + 1.0);
    return mix(color * (compressed / peak), vec3(compressed), grey);
}

// IEC 61966-2-1.
vec3 srgb_from_linear(vec3 c)
{
    c = clamp(c, 0.0, 1.0);
    vec3 high = 1.055 * pow(max(c, vec3(1e-9)), vec3(1.0 / 2.4)) - 0.055;
    return mix(high, 12.92 * c, vec3(lessThanEqual(c, vec3(0.0031308))));
}

void main()
{
    vec3 value = min(texelFetch(s_value, ivec2(gl_FragCoord.xy), 0).rgb * scale.x, 1e15);
    vec3 color = kind.x == 0u ? srgb_from_linear(pbr_neutral(value))
               : kind.x == 1u ? srgb_from_linear(value)
               : kind.x == 2u ? (dot(value, value) > 0.0 ? value * 0.5 + 0.5 : vec3(0.0))
               : clamp(value, 0.0, 1.0);
    o_color = vec4(color, 1.0);
}
