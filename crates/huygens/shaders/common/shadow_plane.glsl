// Direct visibility from the shadow map of parallel rays, by percentage closer filtering (Reeves et al. 1987).

uniform highp sampler2DShadow s_shadow;

// As for the cube map (common/shadow_cube.glsl): texels are compared with the receiver's own plane.
float light_visibility(vec3 position_ws, vec3 normal_ws)
{
    // Width and depth of what the map holds, m.
    float extent = shadow.y / shadow.x;
    vec3 n = mat3(light_from_world) * normal_ws * extent;
    n.z = min(n.z, -1e-4);
    vec3 uvz = (light_from_world * vec4(position_ws, 1.0)).xyz;
    float sine = max(length(n.xy), 1e-3);
    vec2 at = uvz.xy / shadow.x, middle = at + n.xy * ((shadow.z + 0.7) * max(sine + 2.0 * n.z, 0.0) / (sine * sine));
    vec2 first = floor(middle - shadow.z) + 0.5;
    int count = int(ceil(2.0 * shadow.z + 1.0));
    float lit = 0.0, total = 0.0;
    for (int y = 0; y < count; y++) {
        for (int x = 0; x < count; x++) {
            vec2 center = first + vec2(x, y);
            vec2 inside = clamp(shadow.z + 0.5 - abs(center - middle), 1e-6, 1.0);
            vec2 across = (center - at) * shadow.y;
            float along = -dot(n.xy, across) / n.z;
            float rise = length(across) + shadow.w;
            float reference = uvz.z + (along + rise / n.z) / extent;
            lit += inside.x * inside.y * texture(s_shadow, vec3(center * shadow.x, reference));
            total += inside.x * inside.y;
        }
    }
    return lit / total;
}
