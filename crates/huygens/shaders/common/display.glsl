// From linear light to a display.

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
